/* Drives a haptic device that sends positions, and receives feedback, in UDP packets.
 * docs/guide/haptic.md describes the layout of the packets. The sender of the first valid packet is
 * the device; other packets are ignored. */
#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef __linux__
#include <linux/sockios.h>
#include <sys/ioctl.h>
#endif
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "cli/tool_clock.h"
#include "cli/commands/haptic_device.h"

enum {
    VERSION = 1,  /* version of the layout of packets */
    POSITION = 1, /* kinds of packets */
    FEEDBACK = 2,
    END = 3,
    LIFTED = 4,          /* a position with the pen lifted */
    POSITION_BYTES = 80, /* sizes of packets */
    PRESSURE_BYTES = 88, /* a position with the pressure of a stylus */
    FEEDBACK_BYTES = 192,
    PACKETS_MAX = 32 /* maximum number of packets taken in a step */
};

/* Seconds after the last position at which the forces begin to decrease, and at which they are 0:
 * the device may be unplugged. As in samples/haptic_link.h. */
static const double HOLD_SECONDS = 0.05, ZERO_SECONDS = 0.1;

/* Time after the last position at which the pen is lifted. It stays lifted until a new position has
 * arrived, and the proxy has followed the device. */
enum { SILENCE_NS = 250000000 };

typedef struct udp {
    int socket;
    bool known;                /* a valid packet has arrived; `device` is its sender */
    bool ended;                /* the device has sent a packet END */
    struct sockaddr_in device; /* address of the device */
    uint64_t sequence, tag;    /* from the last valid packet; each feedback repeats both numbers */
    uint64_t arrived;          /* tool_clock at the last valid packet */
    uint64_t received;         /* received_at of this packet */
    bool follows;              /* no silence since the proxy was last not behind the device */
    uint64_t ignored;          /* number of invalid packets */
    haptic_pose pose;          /* the last position */
} udp;

/* --- bytes: little-endian on all machines --- */

static uint64_t get_bytes(const uint8_t *at, int bytes)
{
    uint64_t v = 0;
    for (int i = 0; i < bytes; i++)
        v |= (uint64_t)at[i] << 8 * i;
    return v;
}

static double get_real(const uint8_t *at)
{
    uint64_t bits = get_bytes(at, 8);
    double v;
    memcpy(&v, &bits, sizeof v);
    return v;
}

static uint8_t *put_bytes(uint8_t *at, uint64_t v, int bytes)
{
    for (int i = 0; i < bytes; i++)
        at[i] = (uint8_t)(v >> 8 * i);
    return at + bytes;
}

static uint8_t *put_reals(uint8_t *at, const double *v, int count)
{
    for (int i = 0; i < count; i++) {
        uint64_t bits;
        memcpy(&bits, &v[i], sizeof bits);
        at = put_bytes(at, bits, 8);
    }
    return at;
}

/* --- packets --- */

/* Reads the pose from a packet. Returns false if a coordinate is too large, the rotation is not a
 * quaternion of about unit length, or the pressure is not 0 to 1. */
static bool read_pose(const uint8_t *p, ssize_t size, haptic_pose *out)
{
    double square = 0;
    out->pressure = 0;
    if (size == PRESSURE_BYTES) {
        out->pressure = get_real(p + POSITION_BYTES);
        if (!(out->pressure >= 0 && out->pressure <= 1))
            return false;
    }
    /* a stylus without pressure does not paint */
    out->lifted = get_bytes(p + 6, 2) == LIFTED || (size == PRESSURE_BYTES && out->pressure == 0);
    for (int k = 0; k < 3; k++) {
        out->position[k] = get_real(p + 24 + 8 * k);
        if (!(fabs(out->position[k]) <= 0x1p200))
            return false;
    }
    for (int k = 0; k < 4; k++) {
        out->rotation[k] = get_real(p + 48 + 8 * k);
        square += out->rotation[k] * out->rotation[k];
    }
    for (int k = 0; k < 4; k++)
        out->rotation[k] /= sqrt(square);
    return square >= 0.25 && square <= 4;
}

/* Returns the share of the force that the device gets: less than 1 if its positions are late. */
static double force_share(const udp *u)
{
    double seconds = 1e-9 * (double)(tool_clock() - u->arrived);
    return fmax(0, fmin(1, (ZERO_SECONDS - seconds) / (ZERO_SECONDS - HOLD_SECONDS)));
}

static bool is_silent(const udp *u) { return tool_clock() - u->arrived >= SILENCE_NS; }

/* Processes a packet. Returns false if it is not valid, is not from the device, or is older than a
 * packet processed before. */
static bool take_packet(udp *u, const uint8_t *p, ssize_t size, const struct sockaddr_in *from)
{
    haptic_pose pose;
    if ((size != POSITION_BYTES && size != PRESSURE_BYTES) || memcmp(p, "EBPT", 4) != 0 ||
        get_bytes(p + 4, 2) != VERSION)
        return false;
    uint64_t kind = get_bytes(p + 6, 2), sequence = get_bytes(p + 8, 8);
    if (u->known && (from->sin_port != u->device.sin_port ||
                     from->sin_addr.s_addr != u->device.sin_addr.s_addr || sequence <= u->sequence))
        return false;
    if (kind == END && u->known)
        u->ended = true;
    else if ((kind == POSITION || kind == LIFTED) && read_pose(p, size, &pose))
        u->pose = pose;
    else
        return false;
    u->known = true;
    u->device = *from;
    u->sequence = sequence;
    u->tag = get_bytes(p + 16, 8);
    u->arrived = tool_clock();
    return true;
}

/* Returns the system's time in nanoseconds at which it received the packet that was read last, or 0
 * if it is not known. A delayed loop reads packets late. The first call lets the system note the
 * times of later packets. */
static uint64_t received_at(int socket)
{
#ifdef SIOCGSTAMPNS
    struct timespec at;
    if (ioctl(socket, SIOCGSTAMPNS, &at) == 0)
        return (uint64_t)at.tv_sec * 1000000000 + (uint64_t)at.tv_nsec;
#else
    (void)socket;
#endif
    return 0;
}

/* Processes the packets that have arrived; does not wait. Lifts the pen if the device was silent
 * before one of them. */
static void take_all(udp *u)
{
    uint8_t bytes[PRESSURE_BYTES + 1];
    for (int i = 0; i < PACKETS_MAX; i++) {
        struct sockaddr_in from;
        socklen_t length = sizeof from;
        ssize_t size = recvfrom(u->socket, bytes, sizeof bytes, MSG_DONTWAIT | MSG_TRUNC,
                                (struct sockaddr *)&from, &length);
        /* ECONNREFUSED: an earlier feedback did not reach the device, but the device may return */
        if (size < 0 && errno != ECONNREFUSED)
            return;
        if (size < 0)
            continue;
        uint64_t received = received_at(u->socket);
        if (length != sizeof from || !take_packet(u, bytes, size, &from)) {
            u->ignored++;
            continue;
        }
        u->follows &= !(u->received && received >= u->received + SILENCE_NS);
        u->received = received;
    }
}

static void report_port(const udp *u)
{
    struct sockaddr_in at = { .sin_port = 0 };
    socklen_t length = sizeof at;
    char text[64] = "";
    (void)getsockname(u->socket, (struct sockaddr *)&at, &length);
    inet_ntop(AF_INET, &at.sin_addr, text, sizeof text);
    fprintf(stderr, "ebpo haptic: waits for a device at %s, port %u\n", text, ntohs(at.sin_port));
}

static bool begin_udp(void *self, double seconds, haptic_pose *first)
{
    udp *u = self;
    report_port(u);
    uint64_t until = tool_clock() + (uint64_t)(1e9 * fmin(seconds, 1e9));
    while (!u->known && tool_clock() < until) {
        struct pollfd waiting = { .fd = u->socket, .events = POLLIN };
        (void)poll(&waiting, 1, 50);
        take_all(u);
    }
    *first = u->pose;
    if (!u->known)
        fprintf(stderr,
                "ebpo haptic: no device has sent its position in %g seconds (%llu invalid "
                "packets)\n",
                seconds, (unsigned long long)u->ignored);
    return u->known;
}

static bool read_position(void *self, uint64_t step, haptic_pose *out)
{
    udp *u = self;
    (void)step;
    take_all(u);
    *out = u->pose;
    u->follows &= !is_silent(u);
    out->lifted |= !u->follows;
    return !u->ended;
}

static void write_result(void *self, const haptic_result *a)
{
    udp *u = self;
    uint8_t bytes[FEEDBACK_BYTES], *at = bytes;
    double share = force_share(u), force[3], torque[3];
    for (int k = 0; k < 3; k++) {
        force[k] = share * a->force[k];
        torque[k] = share * a->torque[k];
    }
    u->follows |=
        !is_silent(u) && !(a->flags & (EBPO_HAPTIC_WAITING | EBPO_HAPTIC_PATH_UNFINISHED));
    memcpy(at, "EBPT", 4);
    at = put_bytes(at + 4, VERSION, 2);
    at = put_bytes(at, FEEDBACK, 2);
    at = put_bytes(at, u->sequence, 8);
    at = put_bytes(at, u->tag, 8);
    at = put_reals(at, force, 3);
    at = put_reals(at, torque, 3);
    at = put_reals(at, a->proxy.position, 3);
    at = put_reals(at, a->proxy.rotation, 4);
    at = put_reals(at, &a->depth, 1);
    at = put_reals(at, &a->lo, 1);
    at = put_reals(at, &a->hi, 1);
    at = put_reals(at, a->normal, 3);
    at = put_bytes(at, a->face, 8);
    at = put_bytes(at, a->flags, 4);
    memcpy(at, a->rgb, 3);
    at[3] = a->where;
    (void)sendto(u->socket, bytes, sizeof bytes, MSG_DONTWAIT, (const struct sockaddr *)&u->device,
                 sizeof u->device);
}

static void end_udp(void *self)
{
    udp *u = self;
    if (u && u->socket >= 0)
        close(u->socket);
    free(u);
}

/* Reads a name 'udp:PORT' or 'udp:ADDRESS:PORT'. Without an address, only programs on this machine
 * can connect. Returns false for other names. */
static bool read_name(const char *name, struct sockaddr_in *out)
{
    char address[64] = "127.0.0.1", *after;
    const char *port, *colon;
    if (!name || strncmp(name, "udp:", 4) != 0)
        return false;
    port = name + 4;
    colon = strrchr(port, ':');
    if (colon) {
        if (colon - port >= (ptrdiff_t)sizeof address)
            return false;
        memcpy(address, port, (size_t)(colon - port));
        address[colon - port] = 0;
        port = colon + 1;
    }
    if (*port < '0' || *port > '9')
        return false;
    unsigned long number = strtoul(port, &after, 10);
    *out = (struct sockaddr_in){ .sin_family = AF_INET, .sin_port = htons((uint16_t)number) };
    return *after == 0 && number <= 65535 && inet_pton(AF_INET, address, &out->sin_addr) == 1;
}

bool haptic_udp_named(const char *name)
{
    struct sockaddr_in at;
    return read_name(name, &at);
}

bool haptic_udp_open(haptic_device *out, const char *name)
{
    struct sockaddr_in at;
    udp *u = calloc(1, sizeof *u);
    *out = (haptic_device){ begin_udp, read_position, write_result, end_udp, u, 0 };
    if (!u)
        return false;
    u->socket = -1;
    if (!read_name(name, &at))
        return false;
    u->socket = socket(AF_INET, SOCK_DGRAM, 0);
    if (u->socket < 0 || fcntl(u->socket, F_SETFD, FD_CLOEXEC) != 0 ||
        bind(u->socket, (const struct sockaddr *)&at, sizeof at) != 0) {
        fprintf(stderr, "ebpo haptic: %s: %s\n", name, strerror(errno));
        return false;
    }
    (void)received_at(u->socket);
    return true;
}
