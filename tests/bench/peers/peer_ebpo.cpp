// This library, queried like the peers: with the same loops and clocks. The whole model is in
// memory, loaded by `--threads` threads.
#include <ebpo/ebpo.h>

#include "peer.hpp"
#include "processor.h"

namespace
{

// Throws an exception when a call of the library fails.
class outcome
{
  public:
    operator ebpo_error *() { return &error; }
    void must(ebpo_status status) const
    {
        if (status != EBPO_OK)
            throw std::runtime_error(error.message);
    }

  private:
    ebpo_error error = EBPO_ERROR_INIT;
};

class model : public bench::standard
{
  public:
    static constexpr const char *name = "ebpo";
    model() = default;
    model(const model &) = delete;
    ~model()
    {
        ebpo_context_free(context);
        ebpo_model_free(handle);
        ebpo_close(file);
    }
    void load(const char *path)
    {
        ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
        options.threads = bench::threads;
        options.memory = bench::memory;
        done.must(ebpo_open(path, &file, done));
        done.must(ebpo_model_new(file, &options, &handle, done));
        done.must(ebpo_context_new(handle, &context, done));
    }
    void build() {}
    uint64_t bytes() const { return stats().memory; }
    // Prints statistics since the last `begin`.
    void report() const
    {
        ebpo_model_stats now = stats();
        printf(", \"resident\": %s, \"cut_level\": %d, \"memory_peak\": %" PRIu64
               ", \"hits\": %" PRIu64 ", \"loads\": %" PRIu64 ", \"bytes_read\": %" PRIu64,
               now.resident ? "true" : "false", now.cut_level, now.memory_peak,
               now.hits - before.hits, now.loads - before.loads,
               now.bytes_read - before.bytes_read);
    }

  protected:
    ebpo_model_stats stats() const
    {
        ebpo_model_stats out = EBPO_MODEL_STATS_INIT;
        done.must(ebpo_model_get_stats(handle, &out));
        return out;
    }
    void begin_all(const bench::job &job)
    {
        processor_is_base(handle, job.base);
        before = stats();
    }

    ebpo_model_stats before = EBPO_MODEL_STATS_INIT;
    ebpo_file *file = nullptr;
    ebpo_model *handle = nullptr;
    ebpo_context *context = nullptr;
    outcome done;
};

class inside : public model
{
  public:
    static constexpr int doubles = 3;
    using result_type = uint8_t;

    void begin(const bench::job &job) { begin_all(job); }
    uint8_t result(const double *point)
    {
        ebpo_inside_result found;
        done.must(ebpo_inside(context, point, nullptr, &found, done));
        return (uint8_t)found.where;
    }
    void result_all(const double *points, uint64_t count, uint8_t *results)
    {
        std::vector<ebpo_inside_result> found(count);
        done.must(ebpo_inside_many(context, points, count, nullptr, found.data(), done));
        for (uint64_t i = 0; i < count; i++)
            results[i] = (uint8_t)found[i].where;
    }
};

class distance : public model
{
  public:
    static constexpr int doubles = 3;
    using result_type = bench::hit;

    void begin(const bench::job &job)
    {
        begin_all(job);
        options.warm = job.warm;
        options.unsigned_distance = job.plain;
    }
    bench::hit result(const double *point)
    {
        ebpo_distance_result found;
        done.must(ebpo_distance(context, point, &options, &found, done));
        return { found.distance, (int64_t)found.face };
    }
    void result_all(const double *points, uint64_t count, bench::hit *results)
    {
        std::vector<ebpo_distance_result> found(count);
        done.must(ebpo_distance_many(context, points, count, &options, found.data(), done));
        for (uint64_t i = 0; i < count; i++)
            results[i] = { found[i].distance, (int64_t)found[i].face };
    }

  private:
    ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
};

class rays : public model
{
  public:
    static constexpr int doubles = 6;
    using result_type = bench::hit;

    void begin(const bench::job &job)
    {
        begin_all(job);
        tmax = job.tmax;
        query = job.query;
        how = query == "ray" ? &rays::first : query == "ray-any" ? &rays::any : &rays::all;
    }
    bench::hit result(const double *ray) { return (this->*how)(ray); }
    void result_all(const double *points, uint64_t count, bench::hit *results)
    {
        std::vector<ebpo_ray> rays(count);
        for (uint64_t i = 0; i < count; i++) {
            memcpy(rays[i].origin, points + 6 * i, sizeof rays[i].origin);
            memcpy(rays[i].direction, points + 6 * i + 3, sizeof rays[i].direction);
            rays[i].t_max = tmax;
        }
        ebpo_ray_options options = EBPO_RAY_OPTIONS_INIT;
        options.threads = 1;
        if (query == "ray")
            first_many(rays, options, results);
        else if (query == "ray-any")
            any_many(rays, options, results);
        else
            all_many(rays, options, results);
    }

  private:
    static bench::hit reported(const ebpo_ray_hit &hit)
    {
        return { hit.face == EBPO_NO_FACE ? INFINITY : hit.t, (int64_t)hit.face };
    }
    static bench::hit reported_any(bool any)
    {
        return any ? bench::hit{ 0, 0 } : bench::hit{ INFINITY, -1 };
    }
    static bench::hit reported_all(const ebpo_ray_hit *hits, uint64_t count)
    {
        return count ? bench::hit{ (double)count, (int64_t)hits[0].face }
                     : bench::hit{ INFINITY, -1 };
    }

    bench::hit first(const double *ray)
    {
        ebpo_ray_hit hit;
        bool any;
        done.must(ebpo_ray_first(context, ray, ray + 3, tmax, &hit, &any, done));
        return any ? reported(hit) : bench::hit{ INFINITY, -1 };
    }
    bench::hit any(const double *ray)
    {
        bool any;
        done.must(ebpo_ray_any(context, ray, ray + 3, tmax, &any, done));
        return reported_any(any);
    }
    bench::hit all(const double *ray)
    {
        const ebpo_ray_hit *hits;
        uint64_t count;
        done.must(ebpo_ray_all(context, ray, ray + 3, tmax, &hits, &count, done));
        return reported_all(hits, count);
    }

    void first_many(const std::vector<ebpo_ray> &rays, const ebpo_ray_options &options,
                    bench::hit *results)
    {
        std::vector<ebpo_ray_hit> hits(rays.size());
        done.must(
            ebpo_ray_first_many(context, rays.data(), rays.size(), &options, hits.data(), done));
        std::transform(hits.begin(), hits.end(), results, reported);
    }
    void any_many(const std::vector<ebpo_ray> &rays, const ebpo_ray_options &options,
                  bench::hit *results)
    {
        std::unique_ptr<bool[]> any(new bool[rays.size()]);
        done.must(ebpo_ray_any_many(context, rays.data(), rays.size(), &options, any.get(), done));
        std::transform(any.get(), any.get() + rays.size(), results, reported_any);
    }
    void all_many(const std::vector<ebpo_ray> &rays, const ebpo_ray_options &options,
                  bench::hit *results)
    {
        const ebpo_ray_hit *hits;
        const uint64_t *begin;
        done.must(
            ebpo_ray_all_many(context, rays.data(), rays.size(), &options, &hits, &begin, done));
        for (size_t i = 0; i < rays.size(); i++)
            results[i] = reported_all(hits + begin[i], begin[i + 1] - begin[i]);
    }

    double tmax = INFINITY;
    std::string query;
    bench::hit (rays::*how)(const double *) = nullptr;
};

} // namespace

int main(int argc, char **argv) { return bench::main<inside, distance, rays>(argc, argv); }
