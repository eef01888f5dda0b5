// Embree 3 as a peer: one thread (building: more, on request), single precision.
//
// inside: parity of all hits of a ray in a fixed oblique direction, robust scene. distance:
// rtcPointQuery with a shrinking radius. ray, ray-any, ray-all: the first hit, whether there is
// any, and all by a filter function, robust scene of high quality.
#include <embree3/rtcore.h>

#include <atomic>
#include <cmath>

#include "peer.hpp"

namespace
{

// Embree's scene over a mesh whose buffers it shares.
class scene
{
  public:
    scene(RTCSceneFlags flags, RTCBuildQuality quality)
        : device(rtcNewDevice(("threads=" + std::to_string(bench::threads)).c_str())),
          handle(rtcNewScene(device))
    {
        rtcSetDeviceMemoryMonitorFunction(device, count_bytes, &bytes);
        rtcSetSceneFlags(handle, flags);
        rtcSetSceneBuildQuality(handle, quality);
    }
    scene(const scene &) = delete;
    ~scene()
    {
        rtcReleaseScene(handle);
        rtcReleaseDevice(device);
    }

    void load(const char *path)
    {
        triangles = bench::read_ply<float>(path);
        triangles.xyz.resize(triangles.xyz.size() + 1); // Embree reads 16 bytes at the last vertex
    }

    void build(RTCFilterFunctionN occluded_filter)
    {
        RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
        rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                   triangles.xyz.data(), 0, 12, triangles.xyz.size() / 3);
        rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                   triangles.corners.data(), 0, 12, triangles.corners.size() / 3);
        if (occluded_filter)
            rtcSetGeometryOccludedFilterFunction(geometry, occluded_filter);
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(handle, geometry);
        rtcReleaseGeometry(geometry);
        rtcCommitScene(handle);
        if (rtcGetDeviceError(device) != RTC_ERROR_NONE)
            throw std::runtime_error("Embree cannot build");
    }

    static bool count_bytes(void *into, ssize_t more, bool)
    {
        *(std::atomic<uint64_t> *)into += (uint64_t)more;
        return true;
    }

    std::atomic<uint64_t> bytes{ 0 }; // Embree's memory, without the mesh
    RTCDevice device;
    RTCScene handle;
    bench::mesh<float> triangles;
};

// ---- inside ----

struct counting_context {
    RTCIntersectContext base; // the first member: Embree passes its address
    unsigned hits;
};

void count_and_go_on(const RTCFilterFunctionNArguments *arguments)
{
    ((counting_context *)arguments->context)->hits++;
    arguments->valid[0] = 0;
}

class inside : public bench::standard
{
  public:
    static constexpr const char *name = "embree";
    static constexpr int doubles = 3;
    using result_type = uint8_t;

    // No build of high quality: spatial splits would put a face into two leaves, and its hit would
    // count twice.
    inside() : tree(RTC_SCENE_FLAG_ROBUST, RTC_BUILD_QUALITY_MEDIUM)
    {
        if (!rtcGetDeviceProperty(tree.device, RTC_DEVICE_PROPERTY_FILTER_FUNCTION_SUPPORTED))
            throw std::runtime_error("this Embree has no filter functions");
    }
    void load(const char *path) { tree.load(path); }
    void build() { tree.build(count_and_go_on); }
    void begin(const bench::job &) {}
    uint64_t bytes() const { return tree.bytes; }

    uint8_t result(const double *point)
    {
        counting_context context;
        rtcInitIntersectContext(&context.base);
        context.hits = 0;
        RTCRay ray = {};
        ray.org_x = (float)point[0], ray.org_y = (float)point[1], ray.org_z = (float)point[2];
        ray.dir_x = 0.5407f, ray.dir_y = 0.6131f, ray.dir_z = 0.5760f;
        ray.tfar = INFINITY;
        ray.mask = ~0u;
        rtcOccluded1(tree.handle, &context.base, &ray);
        return context.hits & 1;
    }

  private:
    scene tree;
};

// ---- distance ----

struct vec {
    float x, y, z;
};
inline vec operator-(vec a, vec b) { return { a.x - b.x, a.y - b.y, a.z - b.z }; }
inline vec operator*(float s, vec a) { return { s * a.x, s * a.y, s * a.z }; }
inline vec operator+(vec a, vec b) { return { a.x + b.x, a.y + b.y, a.z + b.z }; }
inline float dot(vec a, vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

// Squared distance of p to triangle abc. Source: Ericson, Real-Time Collision Detection (2005),
// section 5.1.5 (by Voronoi regions).
inline float squared_distance(vec p, vec a, vec b, vec c)
{
    vec ab = b - a, ac = c - a, ap = p - a;
    float d1 = dot(ab, ap), d2 = dot(ac, ap);
    if (d1 <= 0 && d2 <= 0)
        return dot(ap, ap);
    vec bp = p - b;
    float d3 = dot(ab, bp), d4 = dot(ac, bp);
    if (d3 >= 0 && d4 <= d3)
        return dot(bp, bp);
    vec cp = p - c;
    float d5 = dot(ab, cp), d6 = dot(ac, cp);
    if (d6 >= 0 && d5 <= d6)
        return dot(cp, cp);
    float wc = d1 * d4 - d3 * d2, wb = d5 * d2 - d1 * d6, wa = d3 * d6 - d5 * d4;
    vec r;
    if (wc <= 0 && d1 >= 0 && d3 <= 0)
        r = ap - d1 / (d1 - d3) * ab;
    else if (wb <= 0 && d2 >= 0 && d6 <= 0)
        r = ap - d2 / (d2 - d6) * ac;
    else if (wa <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0)
        r = bp - (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
    else {
        float scale = 1 / (wa + wb + wc);
        r = ap - (wb * scale * ab + wc * scale * ac);
    }
    return dot(r, r);
}

struct nearest {
    const float *xyz;
    const uint32_t *corners;
    float squared;
    uint32_t face;
};

bool visit(RTCPointQueryFunctionArguments *arguments)
{
    nearest &best = *(nearest *)arguments->userPtr;
    const uint32_t *corner = best.corners + 3 * (size_t)arguments->primID;
    auto vertex = [&](int i) {
        const float *v = best.xyz + 3 * (size_t)corner[i];
        return vec{ v[0], v[1], v[2] };
    };
    RTCPointQuery *query = arguments->query;
    float squared =
        squared_distance({ query->x, query->y, query->z }, vertex(0), vertex(1), vertex(2));
    if (!(squared < best.squared))
        return false;
    best.squared = squared;
    best.face = arguments->primID;
    query->radius = std::sqrt(squared);
    return true;
}

class distance : public bench::standard
{
  public:
    static constexpr const char *name = "embree";
    static constexpr int doubles = 3;
    using result_type = bench::hit;

    // A compact scene is 5 to 25 % faster and needs half the memory. A build of high quality takes
    // three times as long and is not faster here.
    distance() : tree(RTC_SCENE_FLAG_COMPACT, RTC_BUILD_QUALITY_MEDIUM) {}
    void load(const char *path) { tree.load(path); }
    void build() { tree.build(nullptr); }
    void begin(const bench::job &job)
    {
        warm = job.warm;
        last_distance = INFINITY;
    }
    uint64_t bytes() const { return tree.bytes; }

    bench::hit result(const double *point)
    {
        RTCPointQuery query = {};
        query.x = (float)point[0], query.y = (float)point[1], query.z = (float)point[2];
        query.radius = INFINITY;
        if (warm) { // an upper bound of the distance, with a margin for rounding
            vec step = vec{ query.x, query.y, query.z } - last_point;
            query.radius = (last_distance + std::sqrt(dot(step, step))) * 1.00001f + 1e-30f;
            last_point = { query.x, query.y, query.z };
        }
        RTCPointQueryContext context;
        rtcInitPointQueryContext(&context);
        nearest best = { tree.triangles.xyz.data(), tree.triangles.corners.data(), INFINITY,
                         UINT32_MAX };
        rtcPointQuery(tree.handle, &query, &context, visit, &best);
        last_distance = std::sqrt(best.squared);
        return { last_distance, best.face == UINT32_MAX ? -1 : (int64_t)best.face };
    }

  private:
    scene tree;
    bool warm = false;
    vec last_point = { 0, 0, 0 };
    float last_distance = INFINITY;
};

// ---- rays ----

RTCRay ray_of(const double *from, double tmax)
{
    RTCRay ray = {};
    ray.org_x = (float)from[0], ray.org_y = (float)from[1], ray.org_z = (float)from[2];
    ray.dir_x = (float)from[3], ray.dir_y = (float)from[4], ray.dir_z = (float)from[5];
    ray.tfar = (float)tmax;
    ray.mask = ~0u;
    return ray;
}

struct gathering_context {
    RTCIntersectContext base; // the first member: Embree passes its address
    struct intersected {
        float t;
        uint32_t face;
    };
    std::vector<intersected> *list;
};

void gather_and_go_on(const RTCFilterFunctionNArguments *arguments)
{
    const RTCRay *ray = (const RTCRay *)arguments->ray;
    const RTCHit *hit = (const RTCHit *)arguments->hit;
    ((gathering_context *)arguments->context)->list->push_back({ ray->tfar, hit->primID });
    arguments->valid[0] = 0;
}

// Embree's authors recommend high quality for scenes that are built once.
class rays : public bench::standard
{
  public:
    static constexpr const char *name = "embree";
    static constexpr int doubles = 6;
    using result_type = bench::hit;

    rays()
        : tree(RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION,
               bench::only_building ? RTC_BUILD_QUALITY_MEDIUM : RTC_BUILD_QUALITY_HIGH)
    {
    }
    void load(const char *path) { tree.load(path); }
    void build() { tree.build(nullptr); }
    void begin(const bench::job &job)
    {
        tmax = job.tmax;
        how = job.query == "ray" ? &rays::first : job.query == "ray-any" ? &rays::any : &rays::all;
    }
    uint64_t bytes() const { return tree.bytes; }
    bench::hit result(const double *ray) { return (this->*how)(ray); }

  private:
    bench::hit first(const double *from)
    {
        RTCIntersectContext context;
        rtcInitIntersectContext(&context);
        RTCRayHit r = {};
        r.ray = ray_of(from, tmax);
        r.hit.geomID = RTC_INVALID_GEOMETRY_ID;
        rtcIntersect1(tree.handle, &context, &r);
        return { r.ray.tfar, r.hit.geomID == RTC_INVALID_GEOMETRY_ID ? -1 : (int64_t)r.hit.primID };
    }

    bench::hit any(const double *from)
    {
        RTCIntersectContext context;
        rtcInitIntersectContext(&context);
        RTCRay ray = ray_of(from, tmax);
        rtcOccluded1(tree.handle, &context, &ray);
        return ray.tfar < 0 ? bench::hit{ 0, 0 } : bench::hit{ INFINITY, -1 };
    }

    // Returns all hits in order. Spatial splits put a face into several leaves; each face is
    // reported once.
    bench::hit all(const double *from)
    {
        gathering_context context;
        rtcInitIntersectContext(&context.base);
        context.base.filter = gather_and_go_on;
        list.clear();
        context.list = &list;
        RTCRay ray = ray_of(from, tmax);
        rtcOccluded1(tree.handle, &context.base, &ray);
        std::sort(list.begin(), list.end(), [](const auto &a, const auto &b) {
            return a.t != b.t ? a.t < b.t : a.face < b.face;
        });
        auto end = std::unique(list.begin(), list.end(),
                               [](const auto &a, const auto &b) { return a.face == b.face; });
        double count = (double)(end - list.begin());
        return count > 0 ? bench::hit{ count, list[0].face } : bench::hit{ INFINITY, -1 };
    }

    scene tree;
    double tmax = INFINITY;
    bench::hit (rays::*how)(const double *) = nullptr;
    std::vector<gathering_context::intersected> list;
};

} // namespace

int main(int argc, char **argv) { return bench::main<inside, distance, rays>(argc, argv); }
