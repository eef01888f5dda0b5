/* SPDX-License-Identifier: MIT
 * How two faces lie to each other. */
#ifndef EBPO_PAIR_H
#define EBPO_PAIR_H

/* As sets of points; defined in docs/develop/collision.md. */
typedef enum ebpo_pair_kind {
    EBPO_PAIR_APART = 0,
    EBPO_PAIR_TOUCHING = 1, /* a common point; interiors do not meet */
    EBPO_PAIR_CROSSING = 2, /* interiors meet, planes differ */
    EBPO_PAIR_COPLANAR = 3  /* interiors meet in one plane */
} ebpo_pair_kind;

#endif
