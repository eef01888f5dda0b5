/* Queries pairs of models, for the build of the WebAssembly module that includes the functions of
 * collide.h. Both models are in the memory of one instance of the module. */
#include <stdlib.h>
#include <string.h>

#include <ebpo/collide.h>

#include "module.h"

typedef struct ebpo_js_pair {
    ebpo_js_object object; /* for results and errors */
    ebpo_collider *collider;
} ebpo_js_pair;

/* Returns an empty pair; NULL: out of memory. */
ebpo_js_pair *EBPO_JS(ebpo_js_pair_new)(void)
{
    ebpo_js_pair *pair = calloc(1, sizeof *pair);
    if (pair)
        pair->object.error = (ebpo_error)EBPO_ERROR_INIT;
    return pair;
}

/* Sets the models of the pair: two models, or one model twice. A repeated call after EBPO_E_PENDING
 * continues with the same pair. */
int EBPO_JS(ebpo_js_pair_make)(ebpo_js_pair *pair, ebpo_js_object *a, ebpo_js_object *b)
{
    ebpo_collider_options options = EBPO_COLLIDER_OPTIONS_INIT;
    options.threads = 1;
    return ebpo_collider_new(a->model, b->model, &options, &pair->collider, &pair->object.error);
}

void EBPO_JS(ebpo_js_pair_free)(ebpo_js_pair *pair)
{
    ebpo_collider_free(pair->collider);
    ebpo_js_free_arrays(&pair->object);
    free(pair);
}

/* Reads a pose from 13 doubles: rotation (9), translation (3), scale. */
static ebpo_pose read_pose(const double *x)
{
    ebpo_pose pose;
    memcpy(pose.rotation, x, sizeof pose.rotation);
    memcpy(pose.translation, x + 9, sizeof pose.translation);
    pose.scale = x[12];
    return pose;
}

static ebpo_collide_options read_options(const double *poses)
{
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    options.pose_a = read_pose(poses);
    options.pose_b = read_pose(poses + 13);
    return options;
}

static bool take_pairs(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    ebpo_js_object *object = user;
    uint32_t(*faces)[2] = ebpo_js_extend(object, 0, count, sizeof *faces);
    uint8_t *kinds = ebpo_js_extend(object, 1, count, sizeof *kinds);
    uint32_t(*file_faces)[2] = ebpo_js_extend(object, 2, count, sizeof *file_faces);
    for (uint64_t i = 0; i < count && faces && kinds && file_faces; i++) {
        faces[i][0] = (uint32_t)pairs[i].face_a;
        faces[i][1] = (uint32_t)pairs[i].face_b;
        file_faces[i][0] = (uint32_t)pairs[i].file_face_a;
        file_faces[i][1] = (uint32_t)pairs[i].file_face_b;
        kinds[i] = (uint8_t)pairs[i].kind;
    }
    return faces && kinds && file_faces;
}

/* Gets one pair of intersecting faces. Result array 0: uint32 [2], face_a and face_b of
 * ebpo_face_pair. Result array 1: uint8, ebpo_pair_kind. Result array 2: uint32 [2], indices of the
 * faces in the files. If no faces intersect, the arrays are empty. */
int EBPO_JS(ebpo_js_pair_first)(ebpo_js_pair *pair, const double *poses)
{
    ebpo_collide_options options = read_options(poses);
    ebpo_face_pair found;
    int32_t count = 0;
    ebpo_js_clear(&pair->object);
    ebpo_status status =
        ebpo_collide_first(pair->collider, &options, &found, &count, &pair->object.error);
    if (status == EBPO_OK && count == 1 && !take_pairs(&pair->object, &found, 1))
        status = EBPO_E_MEMORY;
    return status;
}

/* Gets all pairs of intersecting faces, in the arrays of ebpo_js_pair_first. */
int EBPO_JS(ebpo_js_pair_all)(ebpo_js_pair *pair, const double *poses)
{
    ebpo_collide_options options = read_options(poses);
    ebpo_js_clear(&pair->object);
    pair->object.error.status = EBPO_OK;
    ebpo_status status =
        ebpo_collide_all(pair->collider, &options, take_pairs, &pair->object, &pair->object.error);
    return pair->object.error.status == EBPO_E_MEMORY ? EBPO_E_MEMORY : status;
}

static bool take_segments(void *user, const ebpo_contact_segment *segments, uint64_t count)
{
    ebpo_js_object *object = user;
    double(*points)[6] = ebpo_js_extend(object, 0, count, sizeof *points);
    uint32_t(*faces)[2] = ebpo_js_extend(object, 1, count, sizeof *faces);
    for (uint64_t i = 0; i < count && points && faces; i++) {
        memcpy(points[i], segments[i].point, sizeof points[i]);
        faces[i][0] = (uint32_t)segments[i].face_a;
        faces[i][1] = (uint32_t)segments[i].face_b;
    }
    return points && faces;
}

/* Gets the segments in which faces cross. Result array 0: double [2][3] for each segment, its ends.
 * Result array 1: uint32 [2] for each segment, its faces. */
int EBPO_JS(ebpo_js_pair_contacts)(ebpo_js_pair *pair, const double *poses)
{
    ebpo_collide_options options = read_options(poses);
    ebpo_js_clear(&pair->object);
    pair->object.error.status = EBPO_OK;
    ebpo_status status = ebpo_collide_contacts(pair->collider, &options, take_segments,
                                               &pair->object, &pair->object.error);
    return pair->object.error.status == EBPO_E_MEMORY ? EBPO_E_MEMORY : status;
}

/* Gets the relation of the models. Result array 0: int32 [2], `relation` and `contact` of
 * ebpo_relation_result. */
int EBPO_JS(ebpo_js_pair_relation)(ebpo_js_pair *pair, const double *poses)
{
    ebpo_collide_options options = read_options(poses);
    ebpo_relation_result result;
    ebpo_js_clear(&pair->object);
    ebpo_status status =
        ebpo_collide_relation(pair->collider, &options, &result, &pair->object.error);
    int32_t out[2] = { result.relation, result.contact };
    return status == EBPO_OK ? ebpo_js_put(&pair->object, 0, out, sizeof out) : status;
}

/* Gets the distance of the models. Result array 0: double [8], the lower and the upper bound of the
 * distance, then the two nearest points. Result array 1: uint32 [2], the faces of these points;
 * UINT32_MAX: no faces. */
int EBPO_JS(ebpo_js_pair_distance)(ebpo_js_pair *pair, const double *poses, double tolerance)
{
    ebpo_collide_options options = read_options(poses);
    ebpo_collide_distance_options distance_options = EBPO_COLLIDE_DISTANCE_OPTIONS_INIT;
    ebpo_collide_distance_result result;
    distance_options.tolerance = tolerance;
    ebpo_js_clear(&pair->object);
    ebpo_status status = ebpo_collide_distance(pair->collider, &options, &distance_options, &result,
                                               &pair->object.error);
    if (status != EBPO_OK)
        return status;
    double out[8] = { result.distance.lo, result.distance.hi };
    memcpy(out + 2, result.point_a, sizeof result.point_a);
    memcpy(out + 5, result.point_b, sizeof result.point_b);
    uint32_t faces[2] = { (uint32_t)result.pair.face_a, (uint32_t)result.pair.face_b };
    if (result.pair.face_a == EBPO_NO_FACE)
        faces[0] = faces[1] = UINT32_MAX;
    status = ebpo_js_put(&pair->object, 0, out, sizeof out);
    return status == EBPO_OK ? ebpo_js_put(&pair->object, 1, faces, sizeof faces) : status;
}
