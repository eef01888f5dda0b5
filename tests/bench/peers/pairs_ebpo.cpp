// Queries contacts and distances with this library on one thread, and makes the poses for all
// programs.
//
//     pairs_ebpo MODEL.ebpo.h5 POSES QUERY ROUNDS [PAIRS]
//         QUERY: first, all, distance (exact), within (a tolerance of 1e-12 of the diagonal)
//     pairs_ebpo MODEL.ebpo.h5 make N
//         prints N poses of each kind. The first four have a penetration in a random direction
//         from the touching pose: slight (1 % of the diagonal), deep (20 %), and the same rotated.
//         none: 2 % outside of the touching pose. apart: at a distance of 1 %.
#include <ebpo/ebpo.h>
#include <ebpo/collide.h>

#include <random>

#include "pairs.hpp"

static ebpo_error error = EBPO_ERROR_INIT;

static void check(ebpo_status status)
{
    if (status != EBPO_OK)
        throw std::runtime_error(error.message);
}

struct two {
    ebpo_file *file;
    ebpo_model *model;
    ebpo_collider *collider;
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_info info;
    double diagonal = 0;

    explicit two(const char *path)
    {
        ebpo_model_options alone = EBPO_MODEL_OPTIONS_INIT;
        alone.threads = 1;
        timespec a, b;
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &a);
        check(ebpo_open(path, &file, &error));
        check(ebpo_model_new(file, &alone, &model, &error));
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &b);
        ebpo_collider_options one = EBPO_COLLIDER_OPTIONS_INIT;
        one.threads = 1;
        check(ebpo_collider_new(model, model, &one, &collider, &error));
        info = *ebpo_file_info(file);
        for (double x : info.box_size)
            diagonal += x * x;
        diagonal = std::sqrt(diagonal);
        seconds = (double)(b.tv_sec - a.tv_sec) + 1e-9 * (double)(b.tv_nsec - a.tv_nsec);
    }
    double seconds;

    void take(const bench::pose &p)
    {
        for (int i = 0; i < 9; i++)
            options.pose_b.rotation[i / 3][i % 3] = p.rotation[i];
        for (int i = 0; i < 3; i++)
            options.pose_b.translation[i] = p.translation[i];
    }

    double distance(double tolerance)
    {
        ebpo_collide_distance_options how = EBPO_COLLIDE_DISTANCE_OPTIONS_INIT;
        ebpo_collide_distance_result out;
        how.tolerance = tolerance;
        check(ebpo_collide_distance(collider, &options, &how, &out, &error));
        return out.distance.hi;
    }
};

static bool keep(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    auto *out = static_cast<bench::face_pairs *>(user);
    for (uint64_t i = 0; i < count; i++)
        out->emplace_back(pairs[i].face_a, pairs[i].face_b);
    return true;
}

static double run_query(two &t, const bench::pose &p, const std::string &query,
                        bench::face_pairs &pairs)
{
    t.take(p);
    if (query == "distance" || query == "within")
        return t.distance(query == "within" ? 1e-12 * t.diagonal : 0);
    if (query == "all") {
        check(ebpo_collide_all(t.collider, &t.options, keep, &pairs, &error));
        return static_cast<double>(pairs.size());
    }
    ebpo_face_pair pair;
    int32_t found;
    check(ebpo_collide_first(t.collider, &t.options, &pair, &found, &error));
    return found;
}

// --- poses ---

// Moves the second copy along `way`, from outside of the first one's ball, until its distance is
// `distance`. Returns the position along `way`.
static double approach(two &t, bench::pose &p, const double way[3], const double start[3],
                       double distance)
{
    double along = 2.2 * t.diagonal;
    for (int i = 0; i < 300; i++) {
        for (int k = 0; k < 3; k++)
            p.translation[k] = start[k] + along * way[k];
        t.take(p);
        double left = t.distance(1e-6 * t.diagonal) - distance;
        if (left < 1e-4 * t.diagonal)
            break;
        along -= left;
    }
    return along;
}

static void print_pose(bench::pose p, const char *kind, const double start[3], double along,
                       const double way[3])
{
    printf("%s", kind);
    for (double x : p.rotation)
        printf(" %.17g", x);
    for (int k = 0; k < 3; k++)
        printf(" %.17g", start[k] + along * way[k]);
    printf("\n");
}

static void turn(bench::pose &p, bool turned, std::mt19937_64 &random)
{
    std::normal_distribution<double> normal;
    double q[4] = { 1, 0, 0, 0 }, n = 0;
    for (double &x : q) {
        x = turned ? normal(random) : x;
        n += x * x;
    }
    double w = q[0], x = q[1], y = q[2], z = q[3];
    double r[9] = { n - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                    2 * (x * y + w * z),     n - 2 * (x * x + z * z), 2 * (y * z - w * x),
                    2 * (x * z - w * y),     2 * (y * z + w * x),     n - 2 * (x * x + y * y) };
    for (int i = 0; i < 9; i++)
        p.rotation[i] = r[i] / n;
}

static void make_poses(two &t, int count)
{
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal;
    for (int i = 0; i < 2 * count; i++) {
        bool turned = i % 2;
        bench::pose p;
        double way[3], start[3], length = 0;
        turn(p, turned, random);
        for (double &x : way) {
            x = normal(random);
            length += x * x;
        }
        for (int k = 0; k < 3; k++) { // start with common centers
            way[k] /= std::sqrt(length);
            start[k] = 0;
            for (int j = 0; j < 3; j++)
                start[k] += ((k == j) - p.rotation[3 * k + j]) *
                            (t.info.box_origin[j] + t.info.box_size[j] / 2);
        }
        double touch = approach(t, p, way, start, 0), d = t.diagonal;
        print_pose(p, turned ? "slight-turned" : "slight", start, touch - 0.01 * d, way);
        print_pose(p, turned ? "deep-turned" : "deep", start, touch - 0.2 * d, way);
        print_pose(p, "none", start, touch + 0.02 * d, way);
        print_pose(p, "apart", start, approach(t, p, way, start, 0.01 * d), way);
    }
}

int main(int count, char **argument)
{
    if (count < 4)
        return 2;
    two t(argument[1]);
    if (!strcmp(argument[2], "make")) {
        make_poses(t, atoi(argument[3]));
        return 0;
    }
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    check(ebpo_model_get_stats(t.model, &stats));
    printf("made %.3f %" PRIu64 "\n", t.seconds, (uint64_t)stats.memory);
    return bench::run_poses(argument + 2, [&](const bench::pose &p, const std::string &query,
                                              bench::face_pairs &pairs) {
        return run_query(t, p, query, pairs);
    });
}
