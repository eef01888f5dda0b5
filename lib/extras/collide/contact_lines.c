/* Joins the segments of all crossing pairs to lines of contact. Two segments are joined where they
 * end at the same features of the same faces.
 *
 * Each end of a segment has a key: for each model, the feature (corner, edge or face) that contains
 * the end. Ends with equal keys are the same point. Corners with equal coordinates have the same
 * index (face_patches.h). A line continues at a point where exactly one segment ends and exactly
 * one segment begins; at all other points it ends. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "extras/collide/pair_faces.h"
#include "extras/collide/face_patches.h"

#define NONE UINT32_MAX

/* Key of an end of a segment. */
typedef struct end_key {
    /* [model] the feature that contains the end. A corner: its index and NONE. An edge: the indices
     * of its two corners, the lesser index first. A face: NONE and its index. */
    uint32_t on[2][2];
    uint32_t end; /* twice the segment's index, plus 1 for its second end */
} end_key;

typedef struct segment {
    ebpo_contact_segment contact;
    double normal[2][3];    /* unit normals of the faces of A and B */
    uint32_t after, before; /* neighbouring segments in the line, or NONE */
    bool reported;          /* the segment belongs to a line that has been made */
} segment;

typedef struct line_search {
    ebpo_pair_faces lookup; /* the look-up of faces by their indices */
    uint64_t most;          /* maximum number of segments */
    segment *segment;       /* [count] */
    end_key *key;           /* [2 count] keys of the ends of all segments */
    uint64_t count, capacity, key_capacity;
    ebpo_corner_ids corners[2]; /* indices of the corners of A and B */
    ebpo_polyline line;         /* the line that is passed to the caller, and its arrays */
    double *points, *normals;
    uint64_t *faces;
    uint64_t points_capacity, normals_capacity, faces_capacity;
    bool full;          /* there are more than `most` segments */
    bool no_memory;     /* an allocation has failed */
    ebpo_status status; /* failure of reading faces, and its error */
    ebpo_error *error;
} line_search;

/* --- gathering --- */

/* Computes the unit normal of a face; 0, 0, 0 if the computed normal has the length 0. */
static void unit_normal(const double t[3][3], double out[3])
{
    double e[2][3], most[2] = { 0, 0 }, length;
    for (int i = 0; i < 2; i++) {
        for (int k = 0; k < 3; k++) {
            e[i][k] = t[i + 1][k] - t[0][k];
            most[i] = fmax(most[i], fabs(e[i][k]));
        }
        for (int k = 0; k < 3 && most[i] > 0; k++)
            e[i][k] /= most[i];
    }
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        out[k] = e[0][u] * e[1][v] - e[0][v] * e[1][u];
    }
    length = sqrt((out[0] * out[0] + out[1] * out[1]) + out[2] * out[2]);
    for (int k = 0; k < 3 && length > 0; k++)
        out[k] /= length;
}

/* Sets `out` to the part of an end_key for a feature of a face of the caller's model m. on: an
 * ebpo_feature: 0 to 2 for a corner, 3 to 5 for an edge, above 5 for the interior. t: the face's
 * corners as in the file. Returns false if memory is short. */
static bool set_feature(line_search *l, int m, uint64_t face, const double t[3][3], unsigned on,
                        uint32_t out[2])
{
    if (on > 5) {
        out[0] = NONE;
        out[1] = (uint32_t)face;
        return true;
    }
    out[1] = NONE;
    if (on < 3)
        return ebpo_corner_id(&l->corners[m], t[on], &out[0]);
    uint32_t a, b;
    if (!ebpo_corner_id(&l->corners[m], t[on - 3], &a) ||
        !ebpo_corner_id(&l->corners[m], t[on == 5 ? 0 : on - 2], &b))
        return false;
    out[0] = a < b ? a : b;
    out[1] = a < b ? b : a;
    return true;
}

/* Adds the segment of a crossing pair, with the keys of its ends. Returns false if memory is short.
 * Sets l->status, and returns true, after a failure of reading. */
static bool add_segment(line_search *l, const ebpo_face_pair *pair)
{
    ebpo_posed_pair faces;
    if (!ebpo_grow(&l->segment, &l->capacity, l->count + 1, sizeof *l->segment) ||
        !ebpo_grow(&l->key, &l->key_capacity, 2 * (l->count + 1), sizeof *l->key))
        return false;
    segment *s = &l->segment[l->count];
    *s = (segment){ .after = NONE, .before = NONE };
    l->status = ebpo_pose_pair(&l->lookup, pair, &faces, l->error);
    if (l->status != EBPO_OK)
        return true;
    ebpo_contact_of(&faces, pair, &s->contact);
    for (int m = 0; m < 2; m++)
        unit_normal((const double(*)[3])faces.corner[m], s->normal[m]);
    for (unsigned e = 0; e < 2; e++) {
        end_key *k = &l->key[2 * l->count + e];
        k->end = (uint32_t)(2 * l->count + e);
        const double(*unposed[2])[3] = { (const double(*)[3])faces.unposed[0],
                                         (const double(*)[3])faces.unposed[1] };
        if (!set_feature(l, 0, pair->file_face_a, unposed[0], s->contact.on_a[e], k->on[0]) ||
            !set_feature(l, 1, pair->file_face_b, unposed[1], s->contact.on_b[e], k->on[1]))
            return false;
    }
    l->count++;
    return true;
}

/* Receives pairs from ebpo_collide_all, and adds the segments of crossing pairs. Returns false
 * after a failure or if there are too many segments. */
static bool receive_pairs(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    line_search *l = user;
    for (uint64_t i = 0; i < count; i++) {
        if (pairs[i].kind != EBPO_PAIR_CROSSING)
            continue;
        l->full = l->count == l->most;
        if (l->full)
            return false;
        l->no_memory = !add_segment(l, &pairs[i]);
        if (l->no_memory || l->status != EBPO_OK)
            return false;
    }
    return true;
}

/* --- joining --- */

/* Compares the features of two keys; returns a negative number, 0 or a positive number. */
static int compare_features(const end_key *p, const end_key *q)
{
    for (int i = 0; i < 4; i++)
        if (p->on[i / 2][i % 2] != q->on[i / 2][i % 2])
            return p->on[i / 2][i % 2] < q->on[i / 2][i % 2] ? -1 : 1;
    return 0;
}

/* Compares two keys by their features, then by their ends, for qsort. */
static int by_features(const void *x, const void *y)
{
    const end_key *p = x, *q = y;
    int order = compare_features(p, q);
    return order ? order : (p->end > q->end) - (p->end < q->end);
}

/* Joins two segments at each point where exactly one segment ends and exactly one segment begins.
 */
static void join_segments(line_search *l)
{
    uint64_t n = 2 * l->count;
    if (n > 0)
        qsort(l->key, n, sizeof *l->key, by_features);
    for (uint64_t i = 0, end; i < n; i = end) {
        for (end = i + 1; end < n && compare_features(&l->key[i], &l->key[end]) == 0;)
            end++;
        uint32_t p = l->key[i].end, q = l->key[end - 1].end;
        if (end != i + 2 || p % 2 == q % 2)
            continue;
        uint32_t from = (p % 2 ? p : q) / 2, to = (p % 2 ? q : p) / 2;
        l->segment[from].after = to;
        l->segment[to].before = from;
    }
}

/* --- output --- */

/* Adds a point to the line. Returns false if memory is short. */
static bool add_point(line_search *l, const double at[3])
{
    /* a copy, because `at` may point into the array that grows */
    const double x[3] = { at[0], at[1], at[2] };
    if (!ebpo_grow(&l->points, &l->points_capacity, 3 * (l->line.count + 1), sizeof *l->points))
        return false;
    memcpy(l->points + 3 * l->line.count++, x, sizeof x);
    return true;
}

/* Adds the first point, the faces and the normals of a segment to the line. The segment's second
 * point is the first point of the next segment. Returns false if memory is short. */
static bool add_to_line(line_search *l, segment *s)
{
    uint64_t n = l->line.count;
    if (!ebpo_grow(&l->faces, &l->faces_capacity, 2 * (n + 1), sizeof *l->faces) ||
        !ebpo_grow(&l->normals, &l->normals_capacity, 6 * (n + 1), sizeof *l->normals) ||
        !add_point(l, s->contact.point[0]))
        return false;
    l->faces[2 * n] = s->contact.face_a;
    l->faces[2 * n + 1] = s->contact.face_b;
    memcpy(l->normals + 6 * n, s->normal, sizeof s->normal);
    s->reported = true;
    return true;
}

/* Makes the line that contains segment i, which has not been reported. Returns false if memory is
 * short. */
static bool make_line(line_search *l, uint32_t i)
{
    uint32_t first = i, last = NONE;
    while (l->segment[first].before != NONE && l->segment[first].before != i)
        first = l->segment[first].before;
    l->line.closed = l->segment[first].before == i;
    if (l->line.closed)
        first = i;
    l->line.count = 0;
    for (uint32_t at = first; at != NONE && !l->segment[at].reported; at = l->segment[at].after) {
        if (!add_to_line(l, &l->segment[at]))
            return false;
        last = at;
    }
    if (!add_point(l, l->line.closed ? l->points : l->segment[last].contact.point[1]))
        return false;
    l->line.points = l->points;
    l->line.faces = l->faces;
    l->line.normals = l->normals;
    return true;
}

/* Makes all lines, and passes them to the caller until the function `take` returns false. */
static ebpo_status pass_lines(line_search *l, ebpo_polylines_fn take, void *user, ebpo_error *error)
{
    for (uint64_t i = 0; i < l->count; i++) {
        if (l->segment[i].reported)
            continue;
        if (!make_line(l, (uint32_t)i))
            return ebpo_fail_memory(error, l->points_capacity * sizeof *l->points);
        if (!take(user, &l->line))
            break;
    }
    return EBPO_OK;
}

/* Fails because memory is short or there are too many segments. */
static ebpo_status fail_lines(const line_search *l, ebpo_error *error)
{
    if (l->no_memory)
        return ebpo_fail_memory(error, l->capacity * sizeof *l->segment);
    return ebpo_fail(error, EBPO_E_LIMIT,
                     "lines of contact: the collider's memory is too small for more than %llu "
                     "segments; give the collider more memory",
                     (unsigned long long)l->most);
}

static void free_lines(line_search *l)
{
    ebpo_pair_faces_end(&l->lookup);
    for (int i = 0; i < 2; i++)
        ebpo_corner_ids_free(&l->corners[i]);
    free(l->segment);
    free(l->key);
    free(l->points);
    free(l->normals);
    free(l->faces);
}

enum {
    SEGMENT_BYTES = 256,   /* memory of a segment with its share of all arrays */
    SEGMENTS_MAX = 1 << 30 /* greatest number of segments, because ends have indices of 32 bits */
};

uint64_t ebpo_contact_lines_max(const ebpo_collider *c)
{
    uint64_t most = c->options.memory / SEGMENT_BYTES;
    return most < SEGMENTS_MAX ? most : SEGMENTS_MAX;
}

ebpo_status ebpo_collide_polylines(ebpo_collider *c, const ebpo_collide_options *options,
                                   ebpo_polylines_fn take, void *user, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_collision q;
    line_search l = { .error = error, .most = ebpo_contact_lines_max(c) };
    ebpo_status status = ebpo_collision_begin(&q, c, options, error);
    if (status == EBPO_OK)
        status = ebpo_pair_faces_begin(&l.lookup, &q, error);
    if (status == EBPO_OK)
        status = ebpo_collide_all(c, options, receive_pairs, &l, error);
    if (status == EBPO_OK)
        status = l.status;
    if (status == EBPO_OK && (l.full || l.no_memory))
        status = fail_lines(&l, error);
    if (status == EBPO_OK) {
        join_segments(&l);
        status = pass_lines(&l, take, user, error);
    }
    free_lines(&l);
    return status;
}
