/* Gets the instances of a scene as operands. */
#include "core/strict_fp.h"

#include <inttypes.h>

#include <ebpo/boolean.h>

#include "core/error.h"

ebpo_status ebpo_boolean_get_operands(ebpo_scene *scene, double time,
                                      ebpo_boolean_operand *operands, uint32_t capacity,
                                      uint32_t *count, ebpo_error *error)
{
    ebpo_scene_counts counts = EBPO_SCENE_COUNTS_INIT;
    ebpo_status status = ebpo_scene_get_counts(scene, &counts);
    *count = counts.instances < UINT32_MAX ? (uint32_t)counts.instances : UINT32_MAX;
    if (status == EBPO_OK && counts.instances > capacity)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "the scene has %" PRIu64 " instances, but at most %" PRIu32
                         " operands are possible",
                         counts.instances, capacity);
    for (uint64_t i = 0; i < counts.instances && status == EBPO_OK; i++) {
        ebpo_scene_instance instance = EBPO_SCENE_INSTANCE_INIT;
        status = ebpo_scene_get_instance(scene, i, &instance);
        if (status == EBPO_OK)
            status = ebpo_scene_pose(scene, i, time, &operands[i].pose, error);
        if (status == EBPO_OK)
            status = ebpo_scene_model(scene, instance.model, &operands[i].model, error);
    }
    return status;
}
