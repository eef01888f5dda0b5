/* Windows has no server for the page of the viewer, and no daemon for 3D mice. */
#include <stdio.h>

#include "cli/commands/haptic_device.h"
#include "cli/commands/haptic_view.h"

haptic_view *haptic_view_begin(const haptic_view_options *options)
{
    (void)options;
    fputs("ebpo haptic: --view is not provided on Windows\n", stderr);
    return NULL;
}

void haptic_view_take(void *user, const haptic_sample *samples, uint64_t count)
{
    (void)user, (void)samples, (void)count;
}

void haptic_view_open_device(haptic_device *out, haptic_view *view) { (void)out, (void)view; }

void haptic_view_end(haptic_view *view) { (void)view; }

bool haptic_spacenav_open(haptic_device *out, const double low[3], const double size[3],
                          double rate, double clearance)
{
    (void)out, (void)low, (void)size, (void)rate, (void)clearance;
    fputs("ebpo haptic: --device spacenav is not provided on Windows\n", stderr);
    return false;
}
