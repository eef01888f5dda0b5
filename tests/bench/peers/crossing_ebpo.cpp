// Moves one model through another, step by step, as in the EBP thesis' scenarios (5.6, 5.7).
//
//     crossing_ebpo A.ebpo.h5 B.ebpo.h5 STEPS QUERY SIZE [MEMORY]
//         QUERY: first, all. SIZE: B's diagonal divided by A's; 0: the original size.
//         MEMORY: budget of each model in bytes; 0: no limit.
//
// B begins beside A along x with touching boxes, and ends on the other side. B's center has an
// offset of 1 % of A's diagonal along y and z, because exactly coinciding models are a special
// case. Each step is queried once, on one thread. Prints the time of opening. Then prints for each
// step the processor time in microseconds, the number of pairs, and the loaded subtrees and bytes.
#include <ebpo/ebpo.h>
#include <ebpo/collide.h>

#include "peer.hpp"

static ebpo_error error = EBPO_ERROR_INIT;

static void check(ebpo_status status)
{
    if (status != EBPO_OK)
        throw std::runtime_error(error.message);
}

static double processor()
{
    timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

struct one {
    ebpo_file *file;
    ebpo_model *model;
    double middle[3], width, diagonal = 0;

    one(const char *path, uint64_t memory)
    {
        ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
        options.threads = 1;
        options.memory = memory ? memory : UINT64_C(1) << 40;
        check(ebpo_open(path, &file, &error));
        check(ebpo_model_new(file, &options, &model, &error));
        const ebpo_info *info = ebpo_file_info(file);
        for (int k = 0; k < 3; k++) {
            middle[k] = info->box_origin[k] + info->box_size[k] / 2;
            diagonal += info->box_size[k] * info->box_size[k];
        }
        diagonal = std::sqrt(diagonal);
        width = info->box_size[0];
    }

    uint64_t bytes() const
    {
        ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
        check(ebpo_model_get_stats(model, &stats));
        return stats.memory;
    }
};

static bool count_pairs(void *user, const ebpo_face_pair *, uint64_t count)
{
    *static_cast<uint64_t *>(user) += count;
    return true;
}

static uint64_t run_query(ebpo_collider *collider, const ebpo_collide_options &options, bool all)
{
    uint64_t pairs = 0;
    if (all) {
        check(ebpo_collide_all(collider, &options, count_pairs, &pairs, &error));
        return pairs;
    }
    ebpo_face_pair pair;
    int32_t found;
    check(ebpo_collide_first(collider, &options, &pair, &found, &error));
    return found == 1;
}

int main(int count, char **argument)
{
    if (count < 6)
        return 2;
    int steps = atoi(argument[3]);
    uint64_t memory = count > 6 ? strtoull(argument[6], nullptr, 10) : 0;
    double begun = processor();
    one a(argument[1], memory), b(argument[2], memory);
    ebpo_collider *collider;
    ebpo_collider_options alone = EBPO_COLLIDER_OPTIONS_INIT;
    alone.threads = 1;
    check(ebpo_collider_new(a.model, b.model, &alone, &collider, &error));
    printf("made %.3f %" PRIu64 "\n", processor() - begun, a.bytes() + b.bytes());
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    double size = atof(argument[5]), scale = size > 0 ? size * a.diagonal / b.diagonal : 1;
    double way = (a.width + scale * b.width) / 2;
    options.pose_b.scale = scale;
    ebpo_collider_stats before = EBPO_COLLIDER_STATS_INIT, after = EBPO_COLLIDER_STATS_INIT;
    for (int i = 0; i <= steps; i++) {
        for (int k = 0; k < 3; k++)
            options.pose_b.translation[k] = a.middle[k] - scale * b.middle[k] + 0.01 * a.diagonal;
        options.pose_b.translation[0] += way * (1 - 2.0 * i / steps);
        check(ebpo_collider_get_stats(collider, &before));
        double start = processor();
        uint64_t pairs = run_query(collider, options, !strcmp(argument[4], "all"));
        double took = processor() - start;
        check(ebpo_collider_get_stats(collider, &after));
        printf("%.3f %" PRIu64 " %" PRIu64 " %" PRIu64 "\n", 1e6 * took, pairs,
               (uint64_t)(after.loads - before.loads),
               (uint64_t)(after.bytes_read - before.bytes_read));
    }
    ebpo_collider_free(collider);
}
