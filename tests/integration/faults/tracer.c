/* A library for LD_PRELOAD: it adds the path of each file that a process opens to a log.

   tracing.py compiles it. OPENED_FILES names the log. A line is the path behind all links, as the kernel knows it; a
   file that was not opened has no line. A program or library that is loaded has one, too. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

static char log_file[PATH_MAX];

__attribute__((constructor)) static void start(void) {
    const char *name = getenv("OPENED_FILES");
    if (name)
        snprintf(log_file, sizeof log_file, "%s", name);
}

static void add(const char *path) {
    char line[PATH_MAX + 2];
    int before = errno;
    if (*log_file) {
        int length = snprintf(line, sizeof line, "%.*s\n", PATH_MAX - 1, path);
        /* A name may hold a newline. */
        for (int at = 0; at < length - 1; at++)
            if (line[at] == '\n')
                line[at] = '?';
        int file = (int)syscall(SYS_openat, AT_FDCWD, log_file, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0666);
        if (file < 0 || syscall(SYS_write, file, line, length) != length)
            abort();
        syscall(SYS_close, file);
    }
    errno = before;
}

/* Add the file behind a descriptor; return the descriptor. */
static int added(int descriptor) {
    char link[64], path[PATH_MAX];
    int before = errno;
    if (descriptor >= 0) {
        snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
        ssize_t length = readlink(link, path, sizeof path - 1);
        path[length < 0 ? 0 : length] = 0;
        add(length < 0 ? "unknown" : path);
    }
    errno = before;
    return descriptor;
}

static void *next(const char *name) {
    void *found = dlsym(RTLD_NEXT, name);
    if (!found)
        abort();
    return found;
}

#define MODE(flags)                                                                                                    \
    mode_t mode = 0;                                                                                                   \
    if ((flags) & (O_CREAT | __O_TMPFILE)) {                                                                           \
        va_list rest;                                                                                                  \
        va_start(rest, flags);                                                                                         \
        mode = va_arg(rest, mode_t);                                                                                   \
        va_end(rest);                                                                                                  \
    }

#define OPEN(name)                                                                                                     \
    int name(const char *path, int flags, ...) {                                                                       \
        MODE(flags)                                                                                                    \
        int (*real)(const char *, int, ...) = next(#name);                                                             \
        return added(real(path, flags, mode));                                                                         \
    }
OPEN(open)
OPEN(open64)

#define OPENAT(name)                                                                                                   \
    int name(int folder, const char *path, int flags, ...) {                                                           \
        MODE(flags)                                                                                                    \
        int (*real)(int, const char *, int, ...) = next(#name);                                                        \
        return added(real(folder, path, flags, mode));                                                                 \
    }
OPENAT(openat)
OPENAT(openat64)

/* The names that programs call if they were compiled with checks. */
#define CHECKED(name)                                                                                                  \
    int name(const char *path, int flags) {                                                                            \
        int (*real)(const char *, int) = next(#name);                                                                  \
        return added(real(path, flags));                                                                               \
    }
CHECKED(__open_2)
CHECKED(__open64_2)

#define CHECKED_AT(name)                                                                                               \
    int name(int folder, const char *path, int flags) {                                                                \
        int (*real)(int, const char *, int) = next(#name);                                                             \
        return added(real(folder, path, flags));                                                                       \
    }
CHECKED_AT(__openat_2)
CHECKED_AT(__openat64_2)

#define FOPEN(name)                                                                                                    \
    FILE *name(const char *path, const char *mode) {                                                                   \
        FILE *(*real)(const char *, const char *) = next(#name);                                                       \
        FILE *file = real(path, mode);                                                                                 \
        if (file)                                                                                                      \
            added(fileno(file));                                                                                       \
        return file;                                                                                                   \
    }
FOPEN(fopen)
FOPEN(fopen64)

#define FREOPEN(name)                                                                                                  \
    FILE *name(const char *path, const char *mode, FILE *stream) {                                                     \
        FILE *(*real)(const char *, const char *, FILE *) = next(#name);                                               \
        FILE *file = real(path, mode, stream);                                                                         \
        if (file)                                                                                                      \
            added(fileno(file));                                                                                       \
        return file;                                                                                                   \
    }
FREOPEN(freopen)
FREOPEN(freopen64)

void *dlopen(const char *path, int flags) {
    void *(*real)(const char *, int) = next("dlopen");
    void *library = real(path, flags);
    char found[PATH_MAX];
    if (library && path && strchr(path, '/') && realpath(path, found))
        add(found);
    return library;
}

int execve(const char *path, char *const words[], char *const variables[]) {
    int (*real)(const char *, char *const[], char *const[]) = next("execve");
    char found[PATH_MAX];
    if (realpath(path, found))
        add(found);
    return real(path, words, variables);
}
