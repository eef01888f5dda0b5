/* SPDX-License-Identifier: MIT
 * Relation of two faces.
 */
#ifndef EBPO_PAIR_H
#define EBPO_PAIR_H

/* Relation of two faces as point sets; defined in docs/develop/collision.md. */
typedef enum ebpo_pair_kind {
    EBPO_PAIR_APART = 0,    /* no common point */
    EBPO_PAIR_TOUCHING = 1, /* a common point; the interiors of the faces do not intersect */
    EBPO_PAIR_CROSSING = 2, /* interiors intersect; the faces are in different planes */
    EBPO_PAIR_COPLANAR = 3  /* interiors intersect; the faces are in one plane */
} ebpo_pair_kind;

#endif
