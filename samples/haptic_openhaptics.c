/* Connects a device of 3D Systems (Touch) to `ebpo haptic --device udp:PORT`, by OpenHaptics. The
 * device is the pen; its first button lifts the pen. Rotations are not sent. Only compiled and run
 * with a stub of OpenHaptics (tests/support/haptic_stubs), never with a real device.
 *
 *     cc samples/haptic_openhaptics.c -o haptic_openhaptics -lHD -lm
 *     haptic_openhaptics PORT X Y Z SCALE STIFFNESS
 *
 * X Y Z: position in the model at the origin of the device. SCALE: the model's unit in metres of
 * the device is 1 / SCALE. STIFFNESS: that of --stiffness, which is the wanted stiffness in N/m
 * divided by SCALE. SIGINT and SIGTERM end the device with force 0. */
#include <HD/hd.h>
#include <stdio.h>
#include <stdlib.h>

#include "haptic_link.h"

typedef struct bridge {
    haptic_link link;
    double origin[3], scale;
} bridge;

/* Called every millisecond. Ends if the device is unplugged; other errors of the device, such as a
 * force that was too great, do not end it. */
static HDCallbackCode HDCALLBACK exchange(void *user)
{
    static const double unit[4] = { 0, 0, 0, 1 };
    bridge *b = user;
    HDdouble millimetres[3], position[3], force[3];
    HDint buttons = 0;
    hdBeginFrame(hdGetCurrentDevice());
    hdGetDoublev(HD_CURRENT_POSITION, millimetres);
    hdGetIntegerv(HD_CURRENT_BUTTONS, &buttons);
    for (int k = 0; k < 3; k++)
        position[k] = b->origin[k] + 0.001 * b->scale * millimetres[k];
    bool continues =
        haptic_link_exchange(&b->link, position, unit, (buttons & HD_DEVICE_BUTTON_1) != 0, force);
    hdSetDoublev(HD_CURRENT_FORCE, force);
    hdEndFrame(hdGetCurrentDevice());
    HDErrorInfo error = hdGetError();
    return error.errorCode == HD_COMM_ERROR || !continues ? HD_CALLBACK_DONE : HD_CALLBACK_CONTINUE;
}

int main(int argc, char **argv)
{
    bridge b;
    HDErrorInfo error;
    HDdouble force_max = 0;
    if (argc != 7) {
        fprintf(stderr, "usage: haptic_openhaptics PORT X Y Z SCALE STIFFNESS\n");
        return 2;
    }
    for (int k = 0; k < 3; k++)
        b.origin[k] = atof(argv[2 + k]);
    b.scale = atof(argv[5]);
    HHD device = hdInitDevice(HD_DEFAULT_DEVICE);
    error = hdGetError();
    if (!HD_DEVICE_ERROR(error))
        hdGetDoublev(HD_NOMINAL_MAX_CONTINUOUS_FORCE, &force_max);
    if (HD_DEVICE_ERROR(error) ||
        !haptic_link_open(&b.link, atoi(argv[1]), atof(argv[6]), force_max)) {
        fprintf(stderr, "haptic_openhaptics: the device or a socket cannot be opened, or STIFFNESS "
                        "is not above 0\n");
        return 1;
    }
    hdEnable(HD_FORCE_OUTPUT);
    HDSchedulerHandle servo = hdScheduleAsynchronous(exchange, &b, HD_MAX_SCHEDULER_PRIORITY);
    hdStartScheduler();
    hdWaitForCompletion(servo, HD_WAIT_INFINITE);
    hdStopScheduler();
    haptic_link_close(&b.link);
    hdDisableDevice(device);
    return 0;
}
