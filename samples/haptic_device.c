/* The device side of `ebpo haptic --device udp:PORT`: moves a pen down into a model and up again,
 * and prints the forces. A driver for a real device reads the position and applies the force at the
 * two comments "driver"; haptic_openhaptics.c and haptic_chai3d.cpp do this.
 *
 *     ebpo haptic --device udp:5601 model.ebpo.h5 &
 *     haptic_device 5601 X Y Z DOWN STIFFNESS
 *
 * STIFFNESS: that of --stiffness, whose default is 400. */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "haptic_link.h"

enum { STEPS = 1000, FORCE_MAX = 10 };

int main(int argc, char **argv)
{
    if (argc != 7) {
        fprintf(stderr, "usage: haptic_device PORT X Y Z DOWN STIFFNESS\n");
        return 2;
    }
    static const double unit[4] = { 0, 0, 0, 1 };
    double position[3] = { atof(argv[2]), atof(argv[3]), atof(argv[4]) }, force[3];
    double strongest = 0, proxy[3] = { 0 };
    haptic_link link;
    if (!haptic_link_open(&link, atoi(argv[1]), atof(argv[6]), FORCE_MAX)) {
        fprintf(stderr, "haptic_device: STIFFNESS is not above 0, or there is no socket\n");
        return 1;
    }
    for (int i = 0; i < STEPS; i++) {
        int depth_step = i < STEPS / 2 ? i : STEPS - i;
        position[2] = atof(argv[4]) -
                      atof(argv[5]) * depth_step / (STEPS / 2); /* driver: read the position */
        if (!haptic_link_exchange(&link, position, unit, false, force))
            break;                  /* driver: apply the force 0 */
        if (force[2] > strongest) { /* driver: apply the force */
            strongest = force[2];
            memcpy(proxy, link.reply.proxy, sizeof proxy);
        }
        nanosleep(&(struct timespec){ 0, 1000000 }, NULL);
    }
    haptic_link_close(&link);
    printf("%s replies, %s force up, proxy at %.2f %.2f %.2f\n", link.sequence ? "some" : "no",
           strongest > 0 ? "a" : "no", proxy[0], proxy[1], proxy[2]);
    return link.sequence ? 0 : 1;
}
