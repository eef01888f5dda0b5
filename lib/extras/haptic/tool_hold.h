/* A tool's way, held back by what its points touch: the nearest one to the way it wants, that takes
 * no point closer to a face than it may. */
#ifndef EBPO_HAPTIC_TOOL_HOLD_H
#define EBPO_HAPTIC_TOOL_HOLD_H

#include <stdint.h>

#include "extras/haptic/rigid.h"

enum { EBPO_CONTACTS_MOST = 256 };

typedef struct ebpo_tool_contact {
    double grip[EBPO_SCREW]; /* grip . way: how far the point comes away from the face */
    double room;             /* so far it may come closer; below 0: it shall come away */
    double gap;
    uint64_t point, face; /* as callers know them */
    double normal[3];
} ebpo_tool_contact;

typedef struct ebpo_tool_contacts {
    ebpo_tool_contact at[EBPO_CONTACTS_MOST]; /* a heap: the largest gap first */
    int count;
} ebpo_tool_contacts;

/* Adds one; when there is no place, instead of the one that has the largest gap. */
void ebpo_tool_contact_add(ebpo_tool_contacts *all, const ebpo_tool_contact *contact);

/* `out`: for all contacts grip . out >= -room, to `close` and as far as bounded work finds it;
 * without `release` none is asked to come away. Returns how many contacts hold. */
int ebpo_tool_hold(const ebpo_tool_contacts *all, const double want[EBPO_SCREW], double close,
                   bool release, double out[EBPO_SCREW]);

#endif
