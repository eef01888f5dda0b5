/* How two faces lie to each other; defined in docs/develop/collision.md. */
#ifndef EBPO_PAIR_PAIR_KIND_H
#define EBPO_PAIR_PAIR_KIND_H

#include <ebpo/collide.h>

#endif
