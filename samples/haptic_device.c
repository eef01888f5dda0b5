/* The device side of `ebpo haptic --device udp:PORT`: moves a pen down into a model and up again,
 * and prints the forces. The two comments "driver" mark where a driver for a real device
 * (OpenHaptics, CHAI3D, a robot controller) reads the position and applies the force.
 *
 *     ebpo haptic --device udp:5601 model.ebpo.h5 &
 *     haptic_device 5601 X Y Z DOWN
 *
 * Packets: docs/guide/haptic.md. Requires a little-endian machine. */
#include <arpa/inet.h>
#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

typedef struct position_packet {
    char magic[4];
    uint16_t version, kind; /* kind 1: a position; kind 3: the end */
    uint64_t sequence, tag;
    double place[3], turn[4]; /* position; rotation as a quaternion (x, y, z, w) */
} position_packet;

typedef struct force_packet {
    char magic[4];
    uint16_t version, kind; /* kind 2: a force */
    uint64_t sequence, tag; /* values of the position packet to which this packet is the reply */
    double force[3], torque[3], proxy[3], turn[4], depth, lo, hi, normal[3];
    uint64_t face;
    uint32_t flags;
    uint8_t rgb[3], where;
} force_packet;

enum { STEPS = 1000 };

int main(int argc, char **argv)
{
    if (argc != 6) {
        fprintf(stderr, "usage: haptic_device PORT X Y Z DOWN\n");
        return 2;
    }
    const struct sockaddr_in to = { .sin_family = AF_INET,
                                    .sin_port = htons((uint16_t)atoi(argv[1])),
                                    .sin_addr.s_addr = htonl(INADDR_LOOPBACK) };
    int s = socket(AF_INET, SOCK_DGRAM, 0);
    if (s < 0 || connect(s, (const struct sockaddr *)&to, sizeof to) != 0)
        return 1;
    position_packet out = {
        "EBPT", 1, 1, 0, 0, { atof(argv[2]), atof(argv[3]), 0 }, { 0, 0, 0, 1 }
    };
    force_packet in = { .depth = 0 }, strongest = in;
    int replies = 0;
    for (int i = 0; i < STEPS; i++) {
        int depth_step = i < STEPS / 2 ? i : STEPS - i;
        out.sequence++;
        out.place[2] = atof(argv[4]) -
                       atof(argv[5]) * depth_step / (STEPS / 2); /* driver: read the position */
        (void)send(s, &out, sizeof out, 0);
        struct pollfd waiting = { .fd = s, .events = POLLIN };
        while (poll(&waiting, 1, 0) > 0 && recv(s, &in, sizeof in, 0) == (ssize_t)sizeof in) {
            replies++;
            if (in.force[2] > strongest.force[2]) /* driver: apply in.force */
                strongest = in;
        }
        nanosleep(&(struct timespec){ 0, 1000000 }, NULL);
    }
    out.kind = 3;
    out.sequence++;
    (void)send(s, &out, sizeof out, 0);
    close(s);
    printf("%s replies, %s force up, proxy at %.2f %.2f %.2f\n", replies > 0 ? "some" : "no",
           strongest.force[2] > 0 ? "a" : "no", strongest.proxy[0], strongest.proxy[1],
           strongest.proxy[2]);
    return replies > 0 ? 0 : 1;
}
