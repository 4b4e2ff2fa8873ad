/* A library for LD_PRELOAD: at chosen calls of libc it returns an error, sends a signal, or moves the clock.

   injection.py compiles it, and describes its settings. All processes of a run share the counters in one file, so that
   "the third call" has a meaning for a run, and not for one process. Interposed are functions that Python, numpy and
   the engines call by name; calls inside libc stay as they are. */

#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <fnmatch.h>
#include <limits.h>
#include <signal.h>
#include <spawn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <time.h>
#include <unistd.h>

struct counters {
    int parent;       /* the process that the run began with */
    unsigned armed;   /* calls count from here on */
    unsigned reached; /* calls that were chosen by name, path and process */
    unsigned fired;   /* those that got the fault */
};

static struct counters *shared;
static const char *calls, *paths, *role, *after;
static unsigned first, times;
static int error, number, to_parent;
static long jump;

static const char *setting(const char *name) {
    const char *value = getenv(name);
    return value ? value : "";
}

__attribute__((constructor)) static void start(void) {
    int file = open(setting("ROS_FAULT_COUNTERS"), O_RDWR | O_CLOEXEC);
    if (file < 0)
        return;
    calls = setting("ROS_FAULT_CALLS");
    paths = setting("ROS_FAULT_PATHS");
    role = setting("ROS_FAULT_ROLE");
    after = setting("ROS_FAULT_AFTER");
    first = (unsigned)atoi(setting("ROS_FAULT_FIRST"));
    times = (unsigned)atoi(setting("ROS_FAULT_TIMES"));
    error = atoi(setting("ROS_FAULT_ERROR"));
    number = atoi(setting("ROS_FAULT_SIGNAL"));
    to_parent = !strcmp(setting("ROS_FAULT_TARGET"), "parent");
    jump = atol(setting("ROS_FAULT_JUMP"));
    struct counters *found = mmap(NULL, sizeof *found, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    close(file);
    if (found == MAP_FAILED)
        abort();
    int nobody = 0;
    if (__atomic_compare_exchange_n(&found->parent, &nobody, getpid(), 0, __ATOMIC_SEQ_CST, __ATOMIC_SEQ_CST)) {
        /* `nohup` and some runners ignore signals, and processes inherit that. */
        if (number && number != SIGKILL)
            signal(number, SIG_DFL);
        found->armed = !*after;
    }
    shared = found;
}

/* True if `word` is one of the words of a list that is separated by commas. */
static int listed(const char *list, const char *word) {
    size_t length = strlen(word);
    if (!length)
        return 0;
    for (const char *at = list; (at = strstr(at, word)); at += length)
        if ((at == list || at[-1] == ',') && (at[length] == ',' || !at[length]))
            return 1;
    return 0;
}

/* Write the absolute path of a file, or that of a descriptor if `name` is NULL. */
static void locate(char *place, int descriptor, const char *name) {
    char link[64], folder[PATH_MAX] = "";
    if (name && *name == '/') {
        snprintf(place, PATH_MAX, "%s", name);
        return;
    }
    snprintf(link, sizeof link, descriptor == AT_FDCWD ? "/proc/self/cwd" : "/proc/self/fd/%d", descriptor);
    ssize_t length = readlink(link, folder, sizeof folder - 1);
    folder[length < 0 ? 0 : length] = 0;
    if (!name)
        snprintf(place, PATH_MAX, "%s", folder);
    else if (snprintf(place, PATH_MAX, "%s/%s", folder, name) < 0)
        *place = 0;
}

/* True if the path matches one of the patterns, which are separated by colons. */
static int matched(const char *patterns, const char *path) {
    char pattern[PATH_MAX];
    for (const char *at = patterns; *at; at += strspn(at, ":")) {
        size_t length = strcspn(at, ":");
        snprintf(pattern, sizeof pattern, "%.*s", (int)length, at);
        if (!fnmatch(pattern, path, 0))
            return 1;
        at += length;
    }
    return 0;
}

/* Count a call. Return 0, or the number of faults so far if it gets one; `errno` is then that of the fault. */
static unsigned due(const char *call, int descriptor, const char *name) {
    char path[PATH_MAX];
    int before = errno, arms;
    if (!shared)
        return 0;
    arms = !shared->armed && !strcmp(call, "open");
    if (!arms && (!shared->armed || !listed(calls, call)))
        return 0;
    if (!arms && *role && (*role == 'p') != (getpid() == shared->parent))
        return 0;
    if (*paths || arms)
        locate(path, descriptor, name);
    errno = before;
    if (arms) {
        shared->armed = matched(after, path);
        return 0;
    }
    if (*paths && !matched(paths, path))
        return 0;
    unsigned count = __atomic_add_fetch(&shared->reached, 1, __ATOMIC_SEQ_CST);
    if (count < first || (times && count >= first + times))
        return 0;
    unsigned fired = __atomic_add_fetch(&shared->fired, 1, __ATOMIC_SEQ_CST);
    if (number)
        kill(to_parent ? shared->parent : getpid(), number);
    errno = error ? error : before;
    return error ? fired : 0;
}

/* libc's own function of this name. */
#define REAL(name)                                                                                                     \
    ({                                                                                                                 \
        static __typeof__(name) *real;                                                                                 \
        if (!real)                                                                                                     \
            real = (__typeof__(name) *)dlsym(RTLD_NEXT, #name);                                                        \
        real;                                                                                                          \
    })

/* NAME(PARAMETERS), which passes ARGUMENTS on, and returns FAILED if it gets the fault. */
#define INTERPOSE(type, failed, call, descriptor, path, name, parameters, arguments)                                   \
    type name parameters { return due(call, descriptor, path) ? failed : REAL(name) arguments; }

/* "create" stands for opening a file that may be written to. */
static int opened(int folder, const char *path, int flags, mode_t mode) {
    if (due("open", folder, path) || ((flags & (O_CREAT | O_WRONLY | O_RDWR)) && due("create", folder, path)))
        return -1;
    return REAL(openat64)(folder, path, flags, mode);
}

#define OPEN(name, folder, parameters)                                                                                 \
    int name parameters {                                                                                              \
        va_list rest;                                                                                                  \
        va_start(rest, flags);                                                                                         \
        mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(rest, mode_t) : 0;                                        \
        va_end(rest);                                                                                                  \
        return opened(folder, path, flags, mode);                                                                      \
    }
OPEN(open, AT_FDCWD, (const char *path, int flags, ...))
OPEN(open64, AT_FDCWD, (const char *path, int flags, ...))
OPEN(openat, folder, (int folder, const char *path, int flags, ...))
OPEN(openat64, folder, (int folder, const char *path, int flags, ...))

#define FOPEN(name)                                                                                                    \
    FILE *name(const char *path, const char *mode) {                                                                   \
        if (due("open", AT_FDCWD, path) || (*mode != 'r' && due("create", AT_FDCWD, path)))                            \
            return NULL;                                                                                               \
        return REAL(name)(path, mode);                                                                                 \
    }
FOPEN(fopen)
FOPEN(fopen64)

/* A disk that fills up takes the first part of what is written; then it stays full. */
ssize_t write(int file, const void *data, size_t size) {
    unsigned fired = due("write", file, NULL);
    if (fired && !(fired == 1 && !times && error == ENOSPC && size > 1))
        return -1;
    return REAL(write)(file, data, fired ? size / 2 : size);
}

/* A stream of C knows an error by a flag, and no caller of the engines asks for it: nothing is read. */
size_t fread(void *data, size_t size, size_t count, FILE *file) {
    return due("read", fileno(file), NULL) ? 0 : REAL(fread)(data, size, count, file);
}

/* Time is the same for all: once a clock has jumped, every process reads the new time. */
int clock_gettime(clockid_t clock, struct timespec *now) {
    const char *call = clock == CLOCK_REALTIME ? "clock" : clock == CLOCK_MONOTONIC ? "monotonic" : "";
    int result = REAL(clock_gettime)(clock, now);
    if (shared && jump && listed(calls, call)) {
        due(call, -1, NULL);
        now->tv_sec += shared->fired ? jump : 0;
    }
    return result;
}

/* A child of `vfork` must not return from here, so it becomes one of `fork`: POSIX allows both to be the same. */
pid_t vfork(void) { return due("fork", -1, NULL) ? -1 : REAL(fork)(); }

INTERPOSE(int, errno, "fork", -1, NULL, posix_spawn,
          (pid_t *process, const char *path, const posix_spawn_file_actions_t *actions, const posix_spawnattr_t *how,
           char *const words[], char *const variables[]),
          (process, path, actions, how, words, variables))
INTERPOSE(pid_t, -1, "fork", -1, NULL, fork, (void), ())
INTERPOSE(ssize_t, -1, "read", file, NULL, read, (int file, void *data, size_t size), (file, data, size))
INTERPOSE(ssize_t, -1, "write", file, NULL, pwrite, (int file, const void *data, size_t size, off_t at),
          (file, data, size, at))
INTERPOSE(ssize_t, -1, "write", file, NULL, pwrite64, (int file, const void *data, size_t size, off64_t at),
          (file, data, size, at))
INTERPOSE(int, -1, "rename", AT_FDCWD, to, rename, (const char *from, const char *to), (from, to))
INTERPOSE(int, -1, "mkdir", AT_FDCWD, path, mkdir, (const char *path, mode_t mode), (path, mode))
INTERPOSE(int, -1, "write", file, NULL, ftruncate, (int file, off_t size), (file, size))
INTERPOSE(int, -1, "write", file, NULL, ftruncate64, (int file, off64_t size), (file, size))
INTERPOSE(int, -1, "sync", file, NULL, fsync, (int file), (file))
INTERPOSE(int, -1, "sync", file, NULL, fdatasync, (int file), (file))
INTERPOSE(int, -1, "open", AT_FDCWD, name, memfd_create, (const char *name, unsigned flags), (name, flags))
INTERPOSE(int, -1, "open", AT_FDCWD, "pipe", pipe2, (int ends[2], int flags), (ends, flags))
INTERPOSE(int, -1, "open", AT_FDCWD, "socket", socket, (int family, int type, int how), (family, type, how))
INTERPOSE(int, -1, "open", AT_FDCWD, "socket", socketpair, (int family, int type, int how, int ends[2]),
          (family, type, how, ends))
INTERPOSE(int, -1, "open", AT_FDCWD, "dup", dup, (int file), (file))
INTERPOSE(DIR *, NULL, "open", AT_FDCWD, path, opendir, (const char *path), (path))
