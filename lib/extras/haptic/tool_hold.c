/* Hildreth's method for the few contacts that matter, which are found one after the other: of all,
 * the one that the way so far offends most. */
#include "core/strict_fp.h"

#include "extras/haptic/tool_hold.h"

enum { ACTIVE = 12, SWEEPS = 20 };

static void swap(ebpo_tool_contacts *all, int i, int j)
{
    ebpo_tool_contact c = all->at[i];
    all->at[i] = all->at[j];
    all->at[j] = c;
}

static void sink(ebpo_tool_contacts *all)
{
    for (int i = 0, child; (child = 2 * i + 1) < all->count; i = child) {
        if (child + 1 < all->count && all->at[child + 1].gap > all->at[child].gap)
            child++;
        if (all->at[child].gap <= all->at[i].gap)
            return;
        swap(all, i, child);
    }
}

void ebpo_tool_contact_add(ebpo_tool_contacts *all, const ebpo_tool_contact *contact)
{
    if (all->count == EBPO_CONTACTS_MOST) {
        if (contact->gap >= all->at[0].gap)
            return;
        all->at[0] = *contact;
        sink(all);
        return;
    }
    int i = all->count++;
    all->at[i] = *contact;
    for (; i > 0 && all->at[(i - 1) / 2].gap < all->at[i].gap; i = (i - 1) / 2)
        swap(all, i, (i - 1) / 2);
}

typedef struct held {
    const ebpo_tool_contacts *all;
    int active[ACTIVE], count;
    double force[ACTIVE], square[ACTIVE];
    bool release;
} held;

static double lacks(const held *h, const ebpo_tool_contact *c, const double way[EBPO_SCREW])
{
    double room = h->release ? c->room : fmax(c->room, 0);
    return -room - screw_dot(c->grip, way);
}

static void sweep(held *h, double close, double way[EBPO_SCREW])
{
    for (int turn = 0; turn < SWEEPS; turn++) {
        double most = 0;
        for (int i = 0; i < h->count; i++) {
            const ebpo_tool_contact *c = &h->all->at[h->active[i]];
            double by = fmax(lacks(h, c, way) / h->square[i], -h->force[i]);
            h->force[i] += by;
            for (int k = 0; k < EBPO_SCREW; k++)
                way[k] += by * c->grip[k];
            most = fmax(most, fabs(by) * h->square[i]);
        }
        if (most <= close / 8)
            return;
    }
}

static int most_offended(const held *h, double close, const double way[EBPO_SCREW])
{
    int found = -1;
    double most = close;
    for (int i = 0; i < h->all->count; i++) {
        double lack = lacks(h, &h->all->at[i], way);
        if (lack > most) {
            most = lack;
            found = i;
        }
    }
    for (int i = 0; i < h->count; i++)
        if (h->active[i] == found)
            return -1; /* more sweeps would do; what is left is looked at when points move */
    return found;
}

int ebpo_tool_hold(const ebpo_tool_contacts *all, const double want[EBPO_SCREW], double close,
                   bool release, double out[EBPO_SCREW])
{
    held h = { .all = all, .release = release };
    int holding = 0;
    for (int k = 0; k < EBPO_SCREW; k++)
        out[k] = want[k];
    while (h.count < ACTIVE) {
        int next = most_offended(&h, close, out);
        if (next < 0)
            break;
        h.active[h.count] = next;
        h.force[h.count] = 0;
        h.square[h.count++] = screw_dot(all->at[next].grip, all->at[next].grip);
        sweep(&h, close, out);
    }
    for (int i = 0; i < h.count; i++)
        holding += h.force[i] > 0;
    return holding;
}
