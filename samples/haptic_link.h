/* Connects a haptic device to `ebpo haptic --device udp:PORT`, and makes the forces safe to apply:
 * a device that applies only forces of haptic_link_step is passive, whatever the network delays,
 * loses or repeats. Used by haptic_device.c, haptic_openhaptics.c and haptic_chai3d.cpp. Lengths
 * are in the model's unit. Requires a little-endian machine. Packets: docs/guide/haptic.md.
 *
 * Passive: at any time, the energy that the hand has received in total is at most the energy that
 * it has given plus stiffness times s^2, where s is the longest motion of the hand in one step.
 * The energy of a step is the force of the step before times the motion. If the force becomes 0,
 * energy that the hand has given and not received is lost, so each contact is passive by itself;
 * s then begins again, unless the hand has received more than it has given.
 * The first position, positions that are not finite, and motions longer than force_max / stiffness
 * in one step are not known motions: the force is 0 at once, and s does not count them.
 *
 * Method: a passivity observer and controller (Hannaford and Ryu 2002) that reduces the force. The
 * greatest allowed force is derived at max_force in lib/extras/haptic/tool.c. */
#ifndef HAPTIC_LINK_H
#define HAPTIC_LINK_H

#include <arpa/inet.h>
#include <math.h>
#include <signal.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

/* Seconds after the last reply to a new position at which the force begins to decrease, and at
 * which it is 0. */
#define HAPTIC_LINK_HOLD 0.05
#define HAPTIC_LINK_ZERO 0.1

/* The bit EBPO_HAPTIC_STOPPED of haptic_reply_packet.flags: the device must end. */
#define HAPTIC_LINK_STOPPED 128u

/* Greatest number of replies that are read in one step. */
#define HAPTIC_LINK_REPLIES 32

/* kind 1: a position; 4: a position that does not paint; 3: the end */
typedef struct haptic_position_packet {
    char magic[4];
    uint16_t version, kind;
    uint64_t sequence, tag;
    double position[3], rotation[4]; /* rotation: a unit quaternion x, y, z, w */
} haptic_position_packet;

/* Do not apply the torque: only the forces of haptic_link_step are passive. */
typedef struct haptic_reply_packet {
    char magic[4];
    uint16_t version, kind; /* kind 2 */
    uint64_t sequence, tag; /* of the position packet to which this packet is the reply */
    double force[3], torque[3], proxy[3], proxy_rotation[4], depth, lo, hi, normal[3];
    uint64_t face;
    uint32_t flags;
    uint8_t rgb[3], where;
} haptic_reply_packet;

/* haptic_link_open sets all members. */
typedef struct haptic_link {
    int socket;
    uint64_t sent;             /* sequence number of the last position packet */
    haptic_reply_packet reply; /* the newest one */
    double stiffness;          /* as --stiffness, above 0 */
    double force_max;          /* of the device */
    double clock;              /* seconds; when haptic_link_exchange was called last */
    bool known;                /* `position` is set and finite */
    double position[3];        /* of the hand in the last step */
    double force[3];           /* applied since the last step */
    double energy;      /* received by the hand in total; negative: the hand has given more */
    double longest;     /* s */
    double received[3]; /* force of the newest reply */
    double age;         /* seconds since the newest reply */
    uint64_t sequence;  /* of the newest reply */
} haptic_link;

/* Takes the force of a reply. Ignores replies to old positions: they do not show that the
 * connection still works in both directions. */
static inline void haptic_link_receive(haptic_link *link, uint64_t sequence, const double force[3])
{
    if (sequence <= link->sequence || !isfinite(force[0] + force[1] + force[2]))
        return;
    link->sequence = sequence;
    link->age = 0;
    for (int k = 0; k < 3; k++)
        link->received[k] = force[k];
}

/* Returns the greatest allowed force. */
static inline double haptic_link_most(const haptic_link *link)
{
    double k = link->stiffness, given = -link->energy, s = link->longest;
    double by_step = s > 0 ? fmin(2 * k * s, k * s + given / s) : 0;
    double by_energy = given > 0 ? 2 * sqrt(k * given) : 0;
    double most = fmax(0, fmax(by_step, by_energy) * (1 - 1e-12));
    return fmin(most, link->force_max);
}

/* Takes the position of the hand. Returns true if the motion since the last step is known. */
static inline bool haptic_link_move(haptic_link *link, const double position[3])
{
    double square = 0, received = 0;
    bool known = isfinite(position[0] + position[1] + position[2]), moved = known && link->known;
    for (int k = 0; k < 3; k++) {
        double motion = moved ? position[k] - link->position[k] : 0;
        received += link->force[k] * motion;
        square += motion * motion;
        link->position[k] = known ? position[k] : link->position[k];
    }
    link->known = known;
    if (!moved || !(link->stiffness * sqrt(square) <= link->force_max))
        return false;
    link->energy += received;
    link->longest = fmax(link->longest, sqrt(square));
    return true;
}

/* Computes the force to apply until the next step. Call it in each step of the device, with the
 * seconds since the last step and the position of the hand, also while no replies arrive. Seconds
 * that are negative or NAN count as forever: the force is 0 until the next reply. */
static inline void haptic_link_step(haptic_link *link, double seconds, const double position[3],
                                    double force[3])
{
    double length = 0, share = 0;
    for (int k = 0; k < 3; k++)
        length += link->received[k] * link->received[k];
    length = sqrt(length);
    link->age += seconds >= 0 ? seconds : INFINITY;
    if (haptic_link_move(link, position))
        share = (HAPTIC_LINK_ZERO - link->age) / (HAPTIC_LINK_ZERO - HAPTIC_LINK_HOLD);
    share = fmax(0, fmin(1, share));
    if (share * length > haptic_link_most(link))
        share = haptic_link_most(link) / length;
    for (int k = 0; k < 3; k++)
        force[k] = link->force[k] = share * link->received[k];
    if (share * length == 0) { /* the contact has ended */
        link->energy = fmax(link->energy, 0);
        link->longest = link->energy > 0 ? link->longest : 0;
    }
}

static volatile sig_atomic_t haptic_link_interrupted;

static inline void haptic_link_interrupt(int signal_number)
{
    (void)signal_number;
    haptic_link_interrupted = 1;
}

/* Returns seconds of a steady clock. */
static inline double haptic_link_clock(void)
{
    struct timespec now = { 0, 0 };
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Prepares to send to a port of this machine. stiffness: that of --stiffness, above 0. force_max:
 * of the device, above 0. SIGINT and SIGTERM then end the device, see haptic_link_exchange. Returns
 * false if an argument is not valid, or the system has no socket. */
static inline bool haptic_link_open(haptic_link *link, int port, double stiffness, double force_max)
{
    struct sockaddr_in to;
    memset(&to, 0, sizeof to);
    to.sin_family = AF_INET;
    to.sin_port = htons((uint16_t)port);
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    memset(link, 0, sizeof *link);
    link->stiffness = stiffness;
    link->force_max = force_max;
    link->clock = haptic_link_clock();
    link->socket = socket(AF_INET, SOCK_DGRAM, 0);
    signal(SIGINT, haptic_link_interrupt);
    signal(SIGTERM, haptic_link_interrupt);
    return stiffness > 0 && force_max > 0 && link->socket >= 0 &&
           connect(link->socket, (const struct sockaddr *)&to, sizeof to) == 0;
}

static inline void haptic_link_send(haptic_link *link, uint16_t kind, const double position[3],
                                    const double rotation[4])
{
    haptic_position_packet packet;
    memset(&packet, 0, sizeof packet);
    memcpy(packet.magic, "EBPT", 4);
    packet.version = 1;
    packet.kind = kind;
    packet.sequence = ++link->sent;
    memcpy(packet.position, position, sizeof packet.position);
    memcpy(packet.rotation, rotation, sizeof packet.rotation);
    (void)send(link->socket, &packet, sizeof packet, MSG_DONTWAIT);
}

/* Returns true if a packet of `size` bytes is a reply to a position that was sent. */
static inline bool haptic_link_valid(const haptic_link *link, const haptic_reply_packet *p,
                                     ssize_t size)
{
    return size == (ssize_t)sizeof *p && memcmp(p->magic, "EBPT", 4) == 0 && p->version == 1 &&
           p->kind == 2 && p->sequence <= link->sent &&
           isfinite(p->force[0] + p->force[1] + p->force[2]);
}

/* Does a step of the device: sends the pose, takes replies, and computes the force to apply. Never
 * waits. Call it every millisecond or so. lifted: the pen does not paint. Returns false if the
 * device must end: apply the force, which is 0, and call haptic_link_close. */
static inline bool haptic_link_exchange(haptic_link *link, const double position[3],
                                        const double rotation[4], bool lifted, double force[3])
{
    struct {
        haptic_reply_packet reply;
        char more; /* detects packets that are too long */
    } got;
    double now = haptic_link_clock(), seconds = now - link->clock;
    link->clock = now;
    haptic_link_send(link, lifted ? 4 : 1, position, rotation);
    for (int i = 0; i < HAPTIC_LINK_REPLIES; i++) {
        ssize_t size = recv(link->socket, &got, sizeof got.reply + 1, MSG_DONTWAIT);
        if (size < 0)
            break;
        if (!haptic_link_valid(link, &got.reply, size))
            continue;
        if (got.reply.sequence > link->sequence)
            link->reply = got.reply;
        haptic_link_receive(link, got.reply.sequence, got.reply.force);
    }
    bool ends = haptic_link_interrupted || link->reply.flags & HAPTIC_LINK_STOPPED;
    haptic_link_step(link, ends ? INFINITY : seconds, position, force);
    return !ends;
}

/* Ends the device and `ebpo haptic`. */
static inline void haptic_link_close(haptic_link *link)
{
    static const double unit[4] = { 0, 0, 0, 1 };
    haptic_link_send(link, 3, link->position, unit);
    close(link->socket);
}

#endif
