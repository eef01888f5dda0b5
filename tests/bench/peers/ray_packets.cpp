// Compares calls for many rays with single calls and with Embree, on one thread.
//
//     ray_packets MODEL.ebpo.h5 MESH.ply RAYS ROUNDS
//         RAYS: 6 doubles for each ray (origin, direction), as written by `ebpo bench
//         --save-points`.
//
// Prints the processor time per ray in nanoseconds, the least of all rounds: single calls, one call
// for all rays, Embree with one ray a call, and Embree with 8 rays a call (robust scene, high
// quality). Results of the two kinds of calls must be equal.
#include <ebpo/ebpo.h>
#include <embree3/rtcore.h>

#include <cmath>
#include <functional>

#include "peer.hpp"

static ebpo_error error = EBPO_ERROR_INIT;

static void check(ebpo_status status)
{
    if (status != EBPO_OK)
        throw std::runtime_error(error.message);
}

static std::vector<ebpo_ray> read_rays(const char *path)
{
    std::vector<ebpo_ray> rays;
    FILE *stream = fopen(path, "rb");
    ebpo_ray ray;
    ray.t_max = INFINITY;
    while (stream && fread(&ray, sizeof(double), 6, stream) == 6)
        rays.push_back(ray);
    if (stream)
        fclose(stream);
    if (rays.empty())
        throw std::runtime_error(std::string(path) + ": no rays");
    return rays;
}

static RTCScene make_scene(bench::mesh<float> &mesh)
{
    RTCDevice device = rtcNewDevice("threads=1");
    RTCScene scene = rtcNewScene(device);
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    mesh.xyz.resize(mesh.xyz.size() + 1); // Embree reads 16 bytes at the last vertex
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                               mesh.xyz.data(), 0, 12, mesh.xyz.size() / 3);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                               mesh.corners.data(), 0, 12, mesh.corners.size() / 3);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcCommitScene(scene);
    return scene;
}

// A result of Embree, as this library stores it, but without the side.
static ebpo_ray_hit make_hit(float t, unsigned geometry, unsigned face)
{
    return { t, geometry == RTC_INVALID_GEOMETRY_ID ? EBPO_NO_FACE : face, 0 };
}

static void cast_alone(RTCScene scene, const std::vector<ebpo_ray> &rays,
                       std::vector<ebpo_ray_hit> &out)
{
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    for (size_t i = 0; i < rays.size(); i++) {
        const ebpo_ray &from = rays[i];
        RTCRayHit r = {};
        r.ray.org_x = (float)from.origin[0], r.ray.dir_x = (float)from.direction[0];
        r.ray.org_y = (float)from.origin[1], r.ray.dir_y = (float)from.direction[1];
        r.ray.org_z = (float)from.origin[2], r.ray.dir_z = (float)from.direction[2];
        r.ray.tfar = INFINITY;
        r.ray.mask = ~0u;
        r.hit.geomID = RTC_INVALID_GEOMETRY_ID;
        rtcIntersect1(scene, &context, &r);
        out[i] = make_hit(r.ray.tfar, r.hit.geomID, r.hit.primID);
    }
}

static void cast_packets(RTCScene scene, const std::vector<ebpo_ray> &rays,
                         std::vector<ebpo_ray_hit> &out)
{
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    for (size_t begin = 0; begin < rays.size(); begin += 8) {
        alignas(32) int valid[8];
        RTCRayHit8 r = {};
        for (size_t i = 0; i < 8; i++) {
            const ebpo_ray &from = rays[std::min(begin + i, rays.size() - 1)];
            valid[i] = begin + i < rays.size() ? -1 : 0;
            r.ray.org_x[i] = (float)from.origin[0], r.ray.dir_x[i] = (float)from.direction[0];
            r.ray.org_y[i] = (float)from.origin[1], r.ray.dir_y[i] = (float)from.direction[1];
            r.ray.org_z[i] = (float)from.origin[2], r.ray.dir_z[i] = (float)from.direction[2];
            r.ray.tfar[i] = INFINITY;
            r.ray.mask[i] = ~0u;
            r.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
        }
        rtcIntersect8(valid, scene, &context, &r);
        for (size_t i = 0; i < 8 && begin + i < rays.size(); i++)
            out[begin + i] = make_hit(r.ray.tfar[i], r.hit.geomID[i], r.hit.primID[i]);
    }
}

int main(int argc, char **argv)
try {
    if (argc != 5)
        throw std::runtime_error("usage: ray_packets MODEL.ebpo.h5 MESH.ply RAYS ROUNDS");
    ebpo_file *file;
    ebpo_model *model;
    ebpo_context *context;
    check(ebpo_open(argv[1], &file, &error));
    check(ebpo_model_new(file, nullptr, &model, &error));
    check(ebpo_context_new(model, &context, &error));
    bench::mesh<float> mesh = bench::read_ply<float>(argv[2]);
    RTCScene scene = make_scene(mesh);
    const std::vector<ebpo_ray> rays = read_rays(argv[3]);
    std::vector<ebpo_ray_hit> single(rays.size()), many(rays.size()), embree(rays.size());
    const std::function<void()> ways[] = {
        [&] {
            for (size_t i = 0; i < rays.size(); i++) {
                bool hit;
                check(ebpo_ray_first(context, rays[i].origin, rays[i].direction, INFINITY,
                                     &single[i], &hit, &error));
                if (!hit)
                    single[i] = { INFINITY, EBPO_NO_FACE, 0 };
            }
        },
        [&] {
            ebpo_ray_options options = EBPO_RAY_OPTIONS_INIT;
            options.threads = 1;
            check(ebpo_ray_first_many(context, rays.data(), rays.size(), &options, many.data(),
                                      &error));
        },
        [&] { cast_alone(scene, rays, embree); },
        [&] { cast_packets(scene, rays, embree); },
    };
    uint64_t least[4] = { UINT64_MAX, UINT64_MAX, UINT64_MAX, UINT64_MAX };
    for (int round = 0; round < atoi(argv[4]); round++)
        for (int i = 0; i < 4; i++) {
            uint64_t begin = bench::nanoseconds(CLOCK_THREAD_CPUTIME_ID);
            ways[i]();
            uint64_t time = bench::nanoseconds(CLOCK_THREAD_CPUTIME_ID) - begin;
            least[i] = std::min(least[i], time);
        }
    for (size_t i = 0; i < rays.size(); i++)
        if (single[i].t != many[i].t || single[i].face != many[i].face ||
            single[i].side != many[i].side)
            throw std::runtime_error("results differ");
    static const char *const names[] = { "single calls", "one call", "Embree", "Embree, 8 rays" };
    for (int i = 0; i < 4; i++)
        printf("%-15s %8.1f\n", names[i], (double)least[i] / (double)rays.size());
    return 0;
} catch (const std::exception &e) {
    fprintf(stderr, "ray_packets: %s\n", e.what());
    return 1;
}
