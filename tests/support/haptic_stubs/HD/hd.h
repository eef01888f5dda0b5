/* A stub of the part of OpenHaptics that samples/haptic_openhaptics.c uses: declarations, and a
 * device that moves 0.3 m down and up again in a second, and is then unplugged. It begins 0.05 m
 * beside its origin, reports a force that was too great once, and measures the energy that it gives
 * to the hand. */
#ifndef EBPO_TESTS_STUB_HD_H
#define EBPO_TESTS_STUB_HD_H

#include <stdio.h>
#include <time.h>

typedef double HDdouble;
typedef int HDint;
typedef unsigned int HDuint, HDenum, HHD;
typedef unsigned long HDSchedulerHandle;
typedef unsigned int HDCallbackCode;
typedef struct HDErrorInfo {
    HDenum errorCode;
} HDErrorInfo;
#define HDCALLBACK
typedef HDCallbackCode (*HDSchedulerCallback)(void *user);

enum { HD_DEFAULT_DEVICE = 0, HD_CALLBACK_DONE = 0, HD_CALLBACK_CONTINUE = 1 };
enum { HD_EXCEEDED_MAX_FORCE = 0x201, HD_COMM_ERROR = 0x302 };
enum { HD_CURRENT_POSITION, HD_CURRENT_BUTTONS, HD_CURRENT_FORCE, HD_NOMINAL_MAX_CONTINUOUS_FORCE };
enum { HD_FORCE_OUTPUT, HD_MAX_SCHEDULER_PRIORITY, HD_WAIT_INFINITE, HD_DEVICE_BUTTON_1 = 1 };
#define HD_DEVICE_ERROR(info) ((info).errorCode != 0)

enum { STUB_FRAMES = 1000 };
static int stub_frame;
static double stub_strongest, stub_energy, stub_force, stub_before;
static HDSchedulerCallback stub_callback;
static void *stub_user;

static HHD hdInitDevice(unsigned name) { return name + 1; }
static HHD hdGetCurrentDevice(void) { return 1; }
static void hdBeginFrame(HHD device) { stub_frame += device == 1; }
static void hdEndFrame(HHD device) { (void)device; }
static void hdEnable(HDenum what) { (void)what; }
static void hdStartScheduler(void) {}
static void hdStopScheduler(void) {}

static HDErrorInfo hdGetError(void)
{
    HDErrorInfo info = { stub_frame < STUB_FRAMES ? 0 : HD_COMM_ERROR };
    if (stub_frame == STUB_FRAMES / 10)
        info.errorCode = HD_EXCEEDED_MAX_FORCE;
    return info;
}

static void hdGetDoublev(HDenum what, HDdouble *out)
{
    int from_end = stub_frame < STUB_FRAMES / 2 ? stub_frame : STUB_FRAMES - stub_frame;
    out[0] = 3.3;
    if (what == HD_CURRENT_POSITION) {
        out[0] = 50;
        out[1] = -300.0 * from_end / (STUB_FRAMES / 2);
        out[2] = 0;
        stub_energy += stub_force * 0.001 * (out[1] - stub_before); /* begins without a force */
        stub_before = out[1];
    }
}

static void hdGetIntegerv(HDenum what, HDint *out) { *out = what != HD_CURRENT_BUTTONS; }

static void hdSetDoublev(HDenum what, const HDdouble *force)
{
    if (what != HD_CURRENT_FORCE)
        return;
    stub_force = force[1];
    stub_strongest = force[1] > stub_strongest ? force[1] : stub_strongest;
}

static HDSchedulerHandle hdScheduleAsynchronous(HDSchedulerCallback callback, void *user,
                                                unsigned priority)
{
    stub_callback = callback;
    stub_user = user;
    return priority;
}

static int hdWaitForCompletion(HDSchedulerHandle handle, HDenum how)
{
    const struct timespec millisecond = { 0, 1000000 };
    (void)handle;
    (void)how;
    while (stub_callback(stub_user) == HD_CALLBACK_CONTINUE)
        nanosleep(&millisecond, NULL);
    return 1;
}

static void hdDisableDevice(HHD device)
{
    printf("device %u: %d frames, last force %.2f, energy %.9f, strongest force up %.2f\n", device,
           stub_frame, stub_force, stub_energy, stub_strongest);
}

#endif
