/* The tick's side of handing boxes over. */
#include "core/strict_fp.h"

#include "extras/haptic/touch_parts.h"

static void swap_boxes(ebpo_touch *t)
{
    unsigned before = t->at;
    t->at = t->seen;
    t->seen = before;
}

bool ebpo_touch_take_box(ebpo_touch *t)
{
    if (!(atomic_load_explicit(&t->between, memory_order_relaxed) & EBPO_TOUCH_FRESH))
        return false;
    unsigned got = atomic_exchange_explicit(&t->between, t->seen, memory_order_acq_rel);
    t->seen = got & ~(unsigned)EBPO_TOUCH_FRESH;
    if (!ebpo_extent_holds(&t->box[t->seen].centres, t->proxy))
        return false; /* it was made for another place */
    swap_boxes(t);
    t->stats.taken++;
    return true;
}

void ebpo_touch_try_other(ebpo_touch *t)
{
    if (ebpo_extent_holds(&t->box[t->seen].centres, t->proxy))
        swap_boxes(t);
}
