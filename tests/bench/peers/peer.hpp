// What the peers' programs have in common: command line, PLY, points, clocks, one line of JSON.
//
// A peer is a class with: `static constexpr int doubles` (of one point: 3; of one ray: 6),
// `answer_type`, and
//     peer(bool warm); void load(const char *path); void build(); answer_type answer(const double
//     *point);
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
#include <numeric>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

namespace bench
{

// Little-endian machines only, as the peers themselves.
static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__,
              "the peers' programs read little-endian numbers as they are");

struct settings {
    std::string model, query, points, answers;
    uint64_t count = UINT64_MAX;
    bool cold = false, warm = false;
};

// Where rays end.
inline double tmax = INFINITY;

// Nothing will be asked: the quality that Embree has by default, as a build that is done often.
inline bool only_building = false;

// For building; where the peer can use more than one. 0: all cores.
inline unsigned threads = 1;

// What is written to --answers: for inside one byte, 1 inside and 0 outside; for the others 16
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

// The vertices' properties may be anything scalar; faces have one list, of 32-bit numbers with
// counts of one byte.
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
            throw std::runtime_error("a face names a vertex that is not there");
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

// Asks the system to forget what it holds of a file, so that the next read goes to the disk.
inline void drop_from_memory(const std::string &path)
{
    int descriptor = open(path.c_str(), O_RDONLY);
    if (descriptor < 0 ||
        (fsync(descriptor), posix_fadvise(descriptor, 0, 0, POSIX_FADV_DONTNEED)) != 0)
        throw std::runtime_error(path + ": cannot be dropped from memory");
    close(descriptor);
}

// ---- clocks and figures ----

inline uint64_t nanoseconds(clockid_t clock = CLOCK_MONOTONIC)
{
    timespec now;
    clock_gettime(clock, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

// Median of what two readings in a row differ by.
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

// Of ascending times: the least that is not exceeded by `share` of them.
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

template <class Answer>
void write_answers(const std::string &path, const std::vector<Answer> &answers)
{
    file out(path, "wb");
    if (fwrite(answers.data(), sizeof(Answer), answers.size(), out.stream) != answers.size())
        throw std::runtime_error(path + ": cannot be written");
}

// ---- the run ----

struct build_times {
    uint64_t start;
    double load, build; // seconds
};

template <class Peer> build_times timed_build(Peer &peer, const settings &s)
{
    if (s.cold)
        drop_from_memory(s.model);
    uint64_t start = nanoseconds();
    peer.load(s.model.c_str());
    uint64_t loaded = nanoseconds();
    peer.build();
    return { start, (double)(loaded - start) * 1e-9, (double)(nanoseconds() - loaded) * 1e-9 };
}

template <class Peer> void run(const settings &s)
{
    std::vector<double> point = read_points(s.points, 1, Peer::doubles);
    Peer peer(s.warm);
    build_times took = timed_build(peer, s);
    volatile auto first = peer.answer(point.data());
    (void)first;
    uint64_t answered = nanoseconds();
    double peak = peak_megabytes();

    point = read_points(s.points, s.count, Peer::doubles);
    uint64_t count = point.size() / Peer::doubles;
    std::vector<typename Peer::answer_type> answers(count);
    std::vector<uint64_t> times(count);
    uint64_t wall = nanoseconds(), processor = nanoseconds(CLOCK_THREAD_CPUTIME_ID);
    for (uint64_t i = 0; i < count; i++)
        answers[i] = peer.answer(&point[i * Peer::doubles]);
    processor = nanoseconds(CLOCK_THREAD_CPUTIME_ID) - processor;
    wall = nanoseconds() - wall;

    uint64_t cost = clock_cost();
    for (uint64_t i = 0; i < count; i++) {
        uint64_t before = nanoseconds();
        answers[i] = peer.answer(&point[i * Peer::doubles]);
        uint64_t took = nanoseconds() - before;
        times[i] = took > cost ? took - cost : 0;
    }
    double clocked = std::accumulate(times.begin(), times.end(), 0.0) / (double)count;
    std::sort(times.begin(), times.end());
    if (!s.answers.empty())
        write_answers(s.answers, answers);
    printf("{\"peer\": \"%s\", \"query\": \"%s\", \"warm\": %s, \"points\": %" PRIu64
           ", \"load_s\": %.6f, \"build_s\": %.6f, "
           "\"first_answer_s\": %.6f, \"mean_ns\": %.1f, \"mean_cpu_ns\": %.1f, "
           "\"clocked_mean_ns\": %.1f, \"p50_ns\": %" PRIu64 ", \"p99_ns\": %" PRIu64
           ", \"p999_ns\": %" PRIu64 ", \"max_ns\": %" PRIu64 ", \"clock_ns\": %" PRIu64
           ", \"peak_mb\": %.1f}\n",
           Peer::name, s.query.c_str(), s.warm ? "true" : "false", count, took.load, took.build,
           (double)(answered - took.start) * 1e-9, (double)wall / (double)count,
           (double)processor / (double)count, clocked, quantile(times, 0.5), quantile(times, 0.99),
           quantile(times, 0.999), times.back(), cost, peak);
}

// Only loads and builds.
template <class Peer> void run_build(const settings &s)
{
    Peer peer(s.warm);
    build_times took = timed_build(peer, s);
    printf("{\"peer\": \"%s\", \"query\": \"build\", \"threads\": %u, \"load_s\": %.6f, "
           "\"build_s\": %.6f, \"peak_mb\": %.1f}\n",
           Peer::name, threads, took.load, took.build, peak_megabytes());
}

inline bool parse(int argc, char **argv, settings &s)
{
    std::vector<std::string> words;
    for (int i = 1; i < argc; i++) {
        std::string word = argv[i];
        if (word == "--cold")
            s.cold = true;
        else if (word == "--warm")
            s.warm = true;
        else if (word == "--count" && i + 1 < argc)
            s.count = strtoull(argv[++i], nullptr, 10);
        else if (word == "--threads" && i + 1 < argc)
            threads = (unsigned)strtoul(argv[++i], nullptr, 10);
        else if (word == "--tmax" && i + 1 < argc)
            tmax = strtod(argv[++i], nullptr);
        else if (word == "--answers" && i + 1 < argc)
            s.answers = argv[++i];
        else if (word.rfind("--", 0) == 0)
            return false;
        else
            words.push_back(word);
    }
    if (words.size() == 2 && words[1] == "build")
        words.push_back("");
    if (words.size() != 3 || !s.count)
        return false;
    s.model = words[0], s.query = words[1], s.points = words[2];
    for (const char *known : { "inside", "distance", "ray", "ray-any", "ray-all", "build" })
        if (s.query == known)
            return true;
    return false;
}

// void: the peer is not asked that.
template <class Peer> void run_if_any(const settings &s)
{
    if constexpr (std::is_void_v<Peer>)
        throw std::runtime_error("this peer does not answer " + s.query);
    else
        run<Peer>(s);
}

template <class Inside, class Distance, class Ray, class Any = void, class All = void>
int main(int argc, char **argv)
{
    settings s;
    if (!parse(argc, argv, s)) {
        fprintf(
            stderr,
            "usage: %s MODEL.ply inside|distance|ray|ray-any|ray-all POINTS.raw [--count N] "
            "[--warm] [--cold] [--tmax T] [--answers FILE]\n"
            "       %s MODEL.ply build [--threads N] [--cold]\n"
            "POINTS.raw: little-endian doubles, x y z for each point; rays: origin and direction.\n"
            "--tmax T  rays end at origin + T direction\n"
            "--warm  distance: search no farther than the last answer allows\n"
            "--cold  ask the system to drop MODEL.ply from its cache first\n"
            "build    only load and build what rays need; --threads 0: on all cores, where the "
            "peer can\n",
            argv[0], argv[0]);
        return 2;
    }
    try {
        if (s.query == "inside")
            run<Inside>(s);
        else if (s.query == "distance")
            run<Distance>(s);
        else if (s.query == "ray-any")
            run_if_any<Any>(s);
        else if (s.query == "ray-all")
            run_if_any<All>(s);
        else if (s.query == "build") {
            only_building = true;
            run_build<Ray>(s);
        } else
            run<Ray>(s);
    } catch (const std::exception &error) {
        fprintf(stderr, "%s: %s\n", argv[0], error.what());
        return 1;
    }
    return 0;
}

} // namespace bench
#endif
