/* Hover at a height: the controller of hover.py in C, with lines of JSON on standard input and output.
 *
 *     cc -O2 -ffp-contract=off -o hover hover.c -lm
 *
 * Without -ffp-contract=off, some compilers merge a multiplication and an addition into one operation, which rounds
 * differently: the robot hovers as well, but not bit by bit as with hover.py.
 */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double MASS = 1.2, GRAVITY = 9.80665;
static const double INERTIA[3] = {0.0134, 0.0134, 0.0176};
#define ARM 0.16
static const struct { const char *link; double x, y, direction; } ROTORS[4] = {
    {"front_left_rotor", ARM, ARM, -1.0},
    {"rear_left_rotor", -ARM, ARM, 1.0},
    {"rear_right_rotor", -ARM, -ARM, -1.0},
    {"front_right_rotor", ARM, -ARM, 1.0},
};
static const double DRAG = 0.02, MAX_THRUST = 6.0;
static const double POSITION = 6.0, SPEED = 4.5, MAX_ACCELERATION = 4.0;
static const double TILT = 120.0, TURN = 20.0, HEADING = 10.0, YAW_RATE = 6.0;

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* Read `count` numbers of the list behind the first `key` after `text`; return the text behind the key. */
static const char *numbers(const char *text, const char *key, double *found, int count)
{
    text = strstr(text, key);
    if (text == NULL || (text = strchr(text, '[')) == NULL) {
        fprintf(stderr, "no %s in a step\n", key);
        exit(1);
    }
    for (int i = 0; i < count; i++) {
        char *end;
        found[i] = strtod(text + 1, &end);
        text = end;
    }
    return text;
}

static void step(const char *line)
{
    const double target[3] = {0.0, 0.0, 1.0};
    double place[3], q[4], speed[3], spin[3], wanted[3];
    const char *rest = strstr(line, "\"pose\"");
    rest = numbers(rest ? rest : line, "\"position_xyz\"", place, 3);
    rest = numbers(rest, "\"orientation_xyzw\"", q, 4);
    rest = numbers(rest, "\"linear_xyz\"", speed, 3);
    numbers(rest, "\"angular_xyz\"", spin, 3);

    /* The axes of the body in the world. */
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    const double ahead[3] = {1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)};
    const double left[3] = {2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)};
    const double up[3] = {2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)};

    for (int i = 0; i < 3; i++) {
        wanted[i] = POSITION * (target[i] - place[i]) - SPEED * speed[i];
        wanted[i] = fmax(-MAX_ACCELERATION, fmin(MAX_ACCELERATION, wanted[i]));
    }
    const double force[3] = {MASS * wanted[0], MASS * wanted[1], MASS * (wanted[2] + GRAVITY)};
    const double thrust = dot(force, up);

    /* The rotation that turns the thrust into the wanted direction, about the axes of the body. */
    const double size = sqrt(dot(force, force));
    const double aim[3] = {force[0] / size, force[1] / size, force[2] / size};
    const double tilt[3] = {
        up[1] * aim[2] - up[2] * aim[1], up[2] * aim[0] - up[0] * aim[2], up[0] * aim[1] - up[1] * aim[0]};
    const double roll_torque = INERTIA[0] * (TILT * dot(tilt, ahead) - TURN * dot(spin, ahead));
    const double pitch_torque = INERTIA[1] * (TILT * dot(tilt, left) - TURN * dot(spin, left));
    const double yaw_torque = INERTIA[2] * (-HEADING * ahead[1] - YAW_RATE * dot(spin, up));

    printf("{\"wrenches\":[");
    for (int i = 0; i < 4; i++) {
        double lift = thrust / 4 + roll_torque * ROTORS[i].y / (4 * ARM * ARM)
                      - pitch_torque * ROTORS[i].x / (4 * ARM * ARM);
        lift = fmax(0.0, fmin(MAX_THRUST, lift + ROTORS[i].direction * yaw_torque / (4 * DRAG)));
        /* 17 digits give the same number when they are read. */
        printf("%s{\"link\":\"%s\",\"frame\":\"%s\",\"force\":[0,0,%.17g],\"torque\":[0,0,%.17g]}", i ? "," : "",
               ROTORS[i].link, ROTORS[i].link, lift, ROTORS[i].direction * DRAG * lift);
    }
    printf("]}\n");
}

int main(void)
{
    char *line = NULL;
    size_t size = 0;
    while (getline(&line, &size, stdin) > 0) {
        if (strncmp(line, "{\"type\":\"step\"", 14) == 0)
            step(line);
        else
            printf("{}\n");
        fflush(stdout);
    }
    free(line);
    return 0;
}
