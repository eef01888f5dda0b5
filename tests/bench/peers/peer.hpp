// Common parts of the peers' programs: command line, PLY, points, clocks, one line of JSON.
//
// A peer has a class for each structure: inside, distance, rays (any of them may be void). A class
// has `static constexpr int doubles` (of one point: 3; of one ray: 6), `result_type`, and
//
//     void load(const char *path);
//     void build();
//     void begin(const job &);
//     result_type result(const double *point);
//     void result_all(const double *points, uint64_t count, result_type *);
//     uint64_t bytes(); // memory in addition to the mesh; 0: unknown
//     void report();    // prints more members of a JSON object
//
// `standard` has defaults for the last three.
#ifndef EBPO_BENCH_PEER_HPP
#define EBPO_BENCH_PEER_HPP

#include <fcntl.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cinttypes>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <iterator>
#include <memory>
#include <numeric>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace bench
{

// The peers' programs run only on little-endian machines.
static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__,
              "the peers' programs read little-endian numbers as they are");

// Queries of one kind: QUERY POINTS.raw, then options.
struct job {
    std::string query, points, results;
    uint64_t count = UINT64_MAX;
    double tmax = INFINITY; // the end of rays
    bool warm = false;      // distance: limit the search by the previous result
    bool clocked = false;   // measure each query separately
    bool batch = false;     // all in one call
    bool base = false;      // use only the base kernels (SSE2)
    bool plain = false;     // distance: unsigned
};

struct settings {
    std::string model;
    job one;
    bool cold = false;
};

// No queries follow: Embree then builds with its default quality, as for frequent builds.
inline bool only_building = false;

// Threads for building, if the peer supports several. 0: all cores.
inline unsigned threads = 1;

// The memory budget of our model in bytes. 0: no limit.
inline uint64_t memory = 0;

// A result in the file of --results: for inside one byte, 1 inside and 0 outside; else these 16
// bytes.
struct hit {
    double value; // distance, the ray's parameter, or for ray-all the number of hits
    int64_t face; // -1: none
};

struct file {
    FILE *stream;
    file(const std::string &path, const char *mode) : stream(fopen(path.c_str(), mode))
    {
        if (!stream)
            throw std::runtime_error(path + ": cannot be opened");
    }
    file(const file &) = delete;
    ~file() { fclose(stream); }
    void read(void *into, size_t bytes)
    {
        if (bytes && fread(into, 1, bytes, stream) != bytes)
            throw std::runtime_error("the file ends too early");
    }
};

// ---- meshes ----

template <class Real> struct mesh {
    std::vector<Real> xyz;
    std::vector<uint32_t> corners;
};

struct ply_head {
    uint64_t vertices = 0, faces = 0;
    size_t vertex_bytes = 0, at[3] = { SIZE_MAX, SIZE_MAX, SIZE_MAX };
    bool wide[3] = {};
};

inline size_t ply_size(const std::string &type)
{
    static const char *const names[] = { "char",  "uchar",   "int8",   "uint8",  "short", "ushort",
                                         "int16", "uint16",  "int",    "uint",   "int32", "uint32",
                                         "float", "float32", "double", "float64" };
    static const size_t sizes[] = { 1, 1, 1, 1, 2, 2, 2, 2, 4, 4, 4, 4, 4, 4, 8, 8 };
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++)
        if (type == names[i])
            return sizes[i];
    throw std::runtime_error("PLY type \"" + type + "\" is not known");
}

// Vertices may have any scalar properties; faces have one list of 32-bit indices with counts of one
// byte.
inline ply_head read_ply_head(FILE *stream)
{
    ply_head head;
    char line[512], a[128], b[128], c[128];
    bool binary = false, in_vertex = false;
    int lists = 0;
    while (fgets(line, sizeof line, stream) && strncmp(line, "end_header", 10) != 0) {
        int words = sscanf(line, "%*s %127s %127s %127s", a, b, c);
        if (!strncmp(line, "format", 6))
            binary = words >= 1 && !strcmp(a, "binary_little_endian");
        else if (!strncmp(line, "element", 7) && words >= 2) {
            in_vertex = !strcmp(a, "vertex");
            (in_vertex ? head.vertices : head.faces) = strtoull(b, nullptr, 10);
        } else if (!strncmp(line, "property", 8) && in_vertex && words >= 2) {
            size_t size = ply_size(a), axis = b[0] - 'x';
            if (axis < 3 && !b[1]) {
                head.at[axis] = head.vertex_bytes;
                head.wide[axis] = size == 8;
            }
            head.vertex_bytes += size;
        } else if (!strncmp(line, "property", 8) && words >= 3) {
            bool plain = !strcmp(a, "list") && ply_size(b) == 1 && ply_size(c) == 4;
            lists += plain ? 1 : 2;
        }
    }
    if (!binary || lists != 1 || std::max({ head.at[0], head.at[1], head.at[2] }) == SIZE_MAX)
        throw std::runtime_error("only binary little-endian PLY with x, y, z and faces as one list "
                                 "(uchar, int) can be read");
    return head;
}

template <class Real> void read_vertices(file &in, const ply_head &head, std::vector<Real> &xyz)
{
    constexpr uint64_t block = 1 << 14;
    std::vector<char> bytes(block * head.vertex_bytes);
    xyz.reserve(3 * head.vertices + 4); // Embree reads 16 bytes at the last vertex
    for (uint64_t done = 0; done < head.vertices; done += block) {
        uint64_t count = std::min(block, head.vertices - done);
        in.read(bytes.data(), count * head.vertex_bytes);
        for (uint64_t i = 0; i < count; i++)
            for (int axis = 0; axis < 3; axis++) {
                const char *from = bytes.data() + i * head.vertex_bytes + head.at[axis];
                float narrow;
                double wide;
                if (head.wide[axis])
                    memcpy(&wide, from, sizeof wide);
                else
                    memcpy(&narrow, from, sizeof narrow);
                xyz.push_back(head.wide[axis] ? (Real)wide : (Real)narrow);
            }
    }
}

inline void read_faces(file &in, const ply_head &head, std::vector<uint32_t> &corners)
{
    constexpr uint64_t block = 1 << 14;
    std::vector<char> bytes(block * 13);
    corners.resize(3 * head.faces);
    for (uint64_t done = 0; done < head.faces; done += block) {
        uint64_t count = std::min(block, head.faces - done);
        in.read(bytes.data(), count * 13);
        for (uint64_t i = 0; i < count; i++) {
            if (bytes[13 * i] != 3)
                throw std::runtime_error("a face is not a triangle");
            memcpy(&corners[3 * (done + i)], &bytes[13 * i + 1], 12);
        }
    }
    for (uint32_t corner : corners)
        if (corner >= head.vertices)
            throw std::runtime_error("a face names a vertex that does not exist");
}

template <class Real> mesh<Real> read_ply(const char *path)
{
    mesh<Real> out;
    file in(path, "rb");
    ply_head head = read_ply_head(in.stream);
    read_vertices(in, head, out.xyz);
    read_faces(in, head, out.corners);
    return out;
}

// Drops a file from the page cache, so that the next read goes to the disk.
inline void drop_from_memory(const std::string &path)
{
    int descriptor = open(path.c_str(), O_RDONLY);
    if (descriptor < 0 ||
        (fsync(descriptor), posix_fadvise(descriptor, 0, 0, POSIX_FADV_DONTNEED)) != 0)
        throw std::runtime_error(path + ": cannot be dropped from memory");
    close(descriptor);
}

// ---- clocks and statistics ----

inline uint64_t nanoseconds(clockid_t clock = CLOCK_MONOTONIC)
{
    timespec now;
    clock_gettime(clock, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

// Returns the median difference of two consecutive readings of the clock.
inline uint64_t clock_cost()
{
    std::vector<uint64_t> costs(10001);
    for (uint64_t &cost : costs) {
        uint64_t start = nanoseconds();
        cost = nanoseconds() - start;
    }
    std::nth_element(costs.begin(), costs.begin() + 5000, costs.end());
    return costs[5000];
}

inline double peak_megabytes()
{
    file status("/proc/self/status", "r");
    char line[256];
    double kilobytes = 0;
    while (fgets(line, sizeof line, status.stream))
        if (sscanf(line, "VmHWM: %lf", &kilobytes) == 1)
            break;
    return kilobytes / 1024;
}

// Returns the quantile `share` of ascending times.
inline uint64_t quantile(const std::vector<uint64_t> &sorted, double share)
{
    size_t rank = (size_t)(share * (double)sorted.size());
    return sorted[std::min(rank, sorted.size() - 1)];
}

inline std::vector<double> read_points(const std::string &path, uint64_t count, int doubles)
{
    file in(path, "rb");
    fseek(in.stream, 0, SEEK_END);
    count = std::min(count, (uint64_t)ftell(in.stream) / (8 * doubles));
    if (!count)
        throw std::runtime_error(path + ": no points");
    rewind(in.stream);
    std::vector<double> points(count * doubles);
    in.read(points.data(), points.size() * 8);
    return points;
}

template <class Result>
void write_results(const std::string &path, const std::vector<Result> &results)
{
    file out(path, "wb");
    if (fwrite(results.data(), sizeof(Result), results.size(), out.stream) != results.size())
        throw std::runtime_error(path + ": cannot be written");
}

// ---- the run ----

struct build_times {
    uint64_t start;
    double load, build, load_cpu, build_cpu; // seconds
};

template <class Peer> build_times timed_build(Peer &peer, const settings &s)
{
    if (s.cold)
        drop_from_memory(s.model);
    uint64_t start = nanoseconds(), cpu = nanoseconds(CLOCK_PROCESS_CPUTIME_ID);
    peer.load(s.model.c_str());
    uint64_t loaded = nanoseconds(), loaded_cpu = nanoseconds(CLOCK_PROCESS_CPUTIME_ID);
    peer.build();
    return { start, (double)(loaded - start) * 1e-9, (double)(nanoseconds() - loaded) * 1e-9,
             (double)(loaded_cpu - cpu) * 1e-9,
             (double)(nanoseconds(CLOCK_PROCESS_CPUTIME_ID) - loaded_cpu) * 1e-9 };
}

template <class Peer> void print_build(const build_times &took, uint64_t bytes)
{
    printf("{\"peer\": \"%s\", \"threads\": %u, \"load_s\": %.6f, \"build_s\": %.6f, "
           "\"load_cpu_s\": %.6f, \"build_cpu_s\": %.6f, \"bytes\": %" PRIu64 ", \"peak_mb\": %.1f",
           Peer::name, threads, took.load, took.build, took.load_cpu, took.build_cpu, bytes,
           peak_megabytes());
}

struct standard {
    uint64_t bytes() const { return 0; }
    void report() const {}
    template <class Result> void result_all(const double *, uint64_t, Result *)
    {
        throw std::runtime_error("this peer runs queries one by one");
    }
};

// Returns ascending times of queries, minus the cost of reading the clock.
template <class Peer, class Result>
std::vector<uint64_t> run_clocked(Peer &peer, const double *points, std::vector<Result> &results)
{
    std::vector<uint64_t> times(results.size());
    uint64_t cost = clock_cost();
    for (uint64_t i = 0; i < times.size(); i++) {
        uint64_t before = nanoseconds();
        results[i] = peer.result(&points[i * Peer::doubles]);
        uint64_t took = nanoseconds() - before;
        times[i] = took > cost ? took - cost : 0;
    }
    std::sort(times.begin(), times.end());
    return times;
}

inline void print_clocked(const std::vector<uint64_t> &times)
{
    printf(", \"clocked_mean_ns\": %.1f, \"p50_ns\": %" PRIu64 ", \"p99_ns\": %" PRIu64
           ", \"p999_ns\": %" PRIu64 ", \"max_ns\": %" PRIu64,
           std::accumulate(times.begin(), times.end(), 0.0) / (double)times.size(),
           quantile(times, 0.5), quantile(times, 0.99), quantile(times, 0.999), times.back());
}

// Runs a job, and prints members of a JSON object.
template <class Peer> void run_job(Peer &peer, const job &j)
{
    std::vector<double> points = read_points(j.points, j.count, Peer::doubles);
    uint64_t count = points.size() / Peer::doubles;
    std::vector<typename Peer::result_type> results(count);
    std::vector<uint64_t> times;
    peer.begin(j);
    uint64_t wall = nanoseconds(), cpu = nanoseconds(CLOCK_THREAD_CPUTIME_ID);
    if (j.clocked)
        times = run_clocked(peer, points.data(), results);
    else if (j.batch)
        peer.result_all(points.data(), count, results.data());
    else
        for (uint64_t i = 0; i < count; i++)
            results[i] = peer.result(&points[i * Peer::doubles]);
    cpu = nanoseconds(CLOCK_THREAD_CPUTIME_ID) - cpu;
    wall = nanoseconds() - wall;
    printf(", \"query\": \"%s\", \"count\": %" PRIu64 ", \"mean_ns\": %.1f, \"mean_cpu_ns\": %.1f",
           j.query.c_str(), count, (double)wall / (double)count, (double)cpu / (double)count);
    peer.report();
    if (!times.empty())
        print_clocked(times);
    if (!j.results.empty())
        write_results(j.results, results);
}

template <class Peer> void run(const settings &s)
{
    std::vector<double> point = read_points(s.one.points, 1, Peer::doubles);
    Peer peer;
    build_times took = timed_build(peer, s);
    peer.begin(s.one);
    volatile auto first = peer.result(point.data());
    (void)first;
    uint64_t ended = nanoseconds();
    print_build<Peer>(took, peer.bytes());
    printf(", \"first_result_s\": %.6f", (double)(ended - took.start) * 1e-9);
    run_job(peer, s.one);
    printf("}\n");
}

// Only loads and builds.
template <class Peer> void run_build(const settings &s)
{
    Peer peer;
    build_times took = timed_build(peer, s);
    print_build<Peer>(took, peer.bytes());
    printf("}\n");
}

inline bool is_query(const std::string &word)
{
    for (const char *known : { "inside", "distance", "ray", "ray-any", "ray-all" })
        if (word == known)
            return true;
    return false;
}

// Parses an option of a job. `value` is the next word, or "".
inline bool parse_job(const std::string &word, const std::string &value, job &j, bool &took)
{
    bool *flags[] = { &j.warm, &j.clocked, &j.batch, &j.base, &j.plain };
    const char *const names[] = { "--warm", "--clocked", "--batch", "--base", "--unsigned" };
    for (int i = 0; i < 5; i++)
        if (word == names[i])
            return *flags[i] = true;
    took = !value.empty();
    if (word == "--count" && took)
        return (j.count = strtoull(value.c_str(), nullptr, 10)) > 0;
    if (word == "--tmax" && took)
        j.tmax = strtod(value.c_str(), nullptr);
    else if (word == "--results" && took)
        j.results = value;
    else
        return false;
    return true;
}

inline bool parse(const std::vector<std::string> &in, settings &s, std::vector<std::string> &words)
{
    for (size_t i = 0; i < in.size(); i++) {
        std::string value = i + 1 < in.size() ? in[i + 1] : "";
        bool took = false;
        if (in[i] == "--cold")
            s.cold = true;
        else if (in[i] == "--threads" && !value.empty())
            threads = (unsigned)strtoul(in[++i].c_str(), nullptr, 10);
        else if (in[i] == "--memory" && !value.empty())
            memory = strtoull(in[++i].c_str(), nullptr, 10);
        else if (in[i].rfind("--", 0) != 0)
            words.push_back(in[i]);
        else if (!parse_job(in[i], value, s.one, took))
            return false;
        else
            i += took;
    }
    return true;
}

inline std::vector<std::string> split(const std::string &line)
{
    std::istringstream in(line);
    return { std::istream_iterator<std::string>(in), {} };
}

// Runs jobs from lines of the standard input until it ends, and prints a line of JSON for each. A
// structure is built for its first job, and kept until a job needs another structure.
template <class Inside, class Distance, class Rays> class server
{
  public:
    explicit server(const settings &s) : base(s) {}
    void run()
    {
        for (std::string line; std::getline(std::cin, line);) {
            settings s;
            std::vector<std::string> words;
            if (!parse(split(line), s, words) || words.size() != 2 || !is_query(words[0]))
                throw std::runtime_error("not a job: " + line);
            s.one.query = words[0], s.one.points = words[1];
            if (s.one.query == "inside")
                one<Inside>(s.one, inside);
            else if (s.one.query == "distance")
                one<Distance>(s.one, distance);
            else
                one<Rays>(s.one, rays);
            fflush(stdout);
        }
    }

  private:
    template <class Peer> void one(const job &j, std::unique_ptr<Peer> &peer)
    {
        if (!peer) {
            inside.reset(), distance.reset(), rays.reset();
            peer = std::make_unique<Peer>();
            took = timed_build(*peer, base);
        }
        print_build<Peer>(took, peer->bytes());
        run_job(*peer, j);
        printf("}\n");
    }

    settings base;
    build_times took = {};
    std::unique_ptr<Inside> inside;
    std::unique_ptr<Distance> distance;
    std::unique_ptr<Rays> rays;
};

template <class Inside, class Distance, class Rays>
bool work(const settings &s, const std::vector<std::string> &words)
{
    if (words.size() == 2 && words[1] == "serve")
        server<Inside, Distance, Rays>(s).run();
    else if (words.size() == 2 && words[1] == "build") {
        only_building = true;
        run_build<Rays>(s);
    } else if (words.size() != 3 || !is_query(words[1]))
        return false;
    else if (words[1] == "inside")
        run<Inside>(s);
    else if (words[1] == "distance")
        run<Distance>(s);
    else
        run<Rays>(s);
    return true;
}

template <class Inside, class Distance, class Rays> int main(int argc, char **argv)
{
    settings s;
    std::vector<std::string> words;
    try {
        if (parse({ argv + 1, argv + argc }, s, words) && words.size() >= 2) {
            s.model = words[0], s.one.query = words[1];
            s.one.points = words.size() > 2 ? words[2] : "";
            if (work<Inside, Distance, Rays>(s, words))
                return 0;
        }
    } catch (const std::exception &error) {
        fprintf(stderr, "%s: %s\n", argv[0], error.what());
        return 1;
    }
    fprintf(stderr,
            "usage: %s MODEL inside|distance|ray|ray-any|ray-all POINTS.raw [--count N] [--warm] "
            "[--unsigned] [--base] [--batch] [--clocked] [--tmax T] [--results FILE] [--cold]\n"
            "       %s MODEL build [--threads N] [--cold]\n"
            "       %s MODEL serve [--threads N] [--memory BYTES]\n"
            "POINTS.raw: little-endian doubles, x y z for each point; rays: origin and direction.\n"
            "--tmax T  rays end at origin + T direction\n"
            "--warm  distance: limit the search by the previous result\n"
            "--batch, --base, --unsigned  ours: all in one call; only base kernels (SSE2); "
            "unsigned distance\n"
            "--clocked  measure each query separately\n"
            "--memory  ours: memory budget of the model\n"
            "--cold  ask the system to drop MODEL from its cache first\n"
            "build    only load, and build the structure for rays; --threads 0: on all cores, if "
            "the peer supports it\n"
            "serve    run jobs from lines of the standard input: the arguments of the first line "
            "after MODEL\n",
            argv[0], argv[0], argv[0]);
    return 2;
}

} // namespace bench
#endif
