/* Drives the tool by a 3D mouse. Reads its motions from spacenavd, by the protocol of libspnav: 32
 * bytes for each event, 8 numbers of 4 bytes in the order of this machine:
 *     0, x, y, z, rx, ry, rz, ms     the deflection of the cap
 *     1 or 2, button                 a button is pressed or released
 * A deflection is a speed. The daemon sends changes only: a cap that is held still keeps its speed
 * until the next event, and an unplugged mouse, too. z points away from the user, so it is the
 * negative z of the model. */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "cli/command.h"
#include "cli/commands/haptic_device.h"

enum { MOTION = 0, PRESS = 1, EVENT_BYTES = 32, EVENTS_MAX = 32, FULL_DEFLECTION = 350 };

/* Full deflection moves by this share of the model's diagonal, and turns by this angle, in a
 * second. */
static const double FULL_SPEED = 0.25, FULL_TURN = 1;

typedef struct mouse {
    int socket;
    bool ended; /* spacenavd has ended */
    haptic_pose pose;
    double origin[3], size[3], diagonal; /* of the model's box */
    double clearance, step_seconds;
    double speed[6];  /* deflection, divided by full deflection */
    int32_t event[8]; /* may be incomplete */
    size_t filled;    /* bytes of `event` */
} mouse;

static void take_event(mouse *m)
{
    const int32_t *e = m->event;
    for (int k = 0; k < 6 && e[0] == MOTION; k++)
        m->speed[k] =
            (k % 3 == 2 ? -1.0 : 1.0) * fmax(-1, fmin(1, e[k + 1] / (double)FULL_DEFLECTION));
    if (e[0] == PRESS)
        m->pose.lifted = !m->pose.lifted;
}

/* Takes the events that have arrived; does not wait. */
static void take_all(mouse *m)
{
    for (int i = 0; i < EVENTS_MAX; i++) {
        ssize_t size =
            recv(m->socket, (char *)m->event + m->filled, EVENT_BYTES - m->filled, MSG_DONTWAIT);
        m->ended |= size == 0 || (size < 0 && errno != EAGAIN && errno != EINTR);
        if (size <= 0)
            return;
        m->filled = (m->filled + (size_t)size) % EVENT_BYTES;
        if (m->filled == 0)
            take_event(m);
    }
}

/* Turns the pose about the axes of the model. */
static void turn_pose(mouse *m, double seconds)
{
    double *q = m->pose.rotation, turn[3], length = 0, turned[4], square = 0;
    for (int k = 0; k < 3; k++) {
        turn[k] = 0.5 * FULL_TURN * seconds * m->speed[3 + k];
        length += turn[k] * turn[k];
    }
    length = sqrt(length);
    double sine = length > 0 ? sin(length) / length : 0, cosine = cos(length);
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        turned[k] = cosine * q[k] + sine * (turn[k] * q[3] + turn[i] * q[j] - turn[j] * q[i]);
    }
    turned[3] = cosine * q[3] - sine * (turn[0] * q[0] + turn[1] * q[1] + turn[2] * q[2]);
    for (int k = 0; k < 4; k++)
        square += turned[k] * turned[k];
    for (int k = 0; k < 4; k++)
        q[k] = turned[k] / sqrt(square);
}

/* The tool stays within a diagonal of the model's box. */
static bool read_pose(void *self, uint64_t step, haptic_pose *out)
{
    mouse *m = self;
    (void)step;
    take_all(m);
    for (int k = 0; k < 3; k++) {
        double to = m->pose.position[k] + FULL_SPEED * m->diagonal * m->step_seconds * m->speed[k];
        double wide = m->diagonal + m->clearance;
        m->pose.position[k] = fmax(m->origin[k] - wide, fmin(m->origin[k] + m->size[k] + wide, to));
    }
    turn_pose(m, m->step_seconds);
    *out = m->pose;
    return !m->ended;
}

/* Connects to the socket that libspnav uses, too. */
static bool connect_daemon(mouse *m)
{
    const char *path = getenv("SPNAV_SOCKET");
    struct sockaddr_un to = { .sun_family = AF_UNIX };
    snprintf(to.sun_path, sizeof to.sun_path, "%s", path && *path ? path : "/var/run/spnav.sock");
    m->socket = socket(AF_UNIX, SOCK_STREAM, 0);
    if (m->socket >= 0 && fcntl(m->socket, F_SETFD, FD_CLOEXEC) == 0 &&
        connect(m->socket, (const struct sockaddr *)&to, sizeof to) == 0)
        return true;
    fprintf(stderr,
            "ebpo haptic: %s: the 3D mouse cannot be read: %s; install and start spacenavd\n",
            to.sun_path, strerror(errno));
    return false;
}

/* The tool begins in front of the model. */
static bool begin_mouse(void *self, double seconds, haptic_pose *first)
{
    mouse *m = self;
    (void)seconds;
    for (int k = 0; k < 3; k++)
        m->pose.position[k] = m->origin[k] + 0.5 * m->size[k];
    m->pose.position[2] += 0.5 * m->size[2] + m->clearance + 0.05 * m->diagonal;
    m->pose.rotation[3] = 1;
    *first = m->pose;
    return true;
}

static void end_mouse(void *self)
{
    mouse *m = self;
    if (m && m->socket >= 0)
        close(m->socket);
    free(m);
}

bool haptic_spacenav_open(haptic_device *out, const double low[3], const double size[3],
                          double rate, double clearance)
{
    mouse *m = calloc(1, sizeof *m);
    *out = (haptic_device){ begin_mouse, read_pose, NULL, end_mouse, m, 0 };
    if (!m)
        return command_no_memory("haptic") == EXIT_OK;
    memcpy(m->origin, low, sizeof m->origin);
    memcpy(m->size, size, sizeof m->size);
    m->diagonal = hypot(hypot(m->size[0], m->size[1]), m->size[2]);
    m->clearance = clearance;
    m->step_seconds = 1 / rate;
    m->socket = -1;
    return connect_daemon(m);
}
