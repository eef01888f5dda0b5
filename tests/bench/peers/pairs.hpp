// Common parts of the programs that query contacts and distances of two copies of a model.
//
// A line of a file of poses has a kind, nine numbers of the rotation by rows, and three of the
// translation. The second copy has this pose; the first copy is not moved.
#ifndef EBPO_BENCH_PAIRS_HPP
#define EBPO_BENCH_PAIRS_HPP

#include <fstream>

#include "peer.hpp"

namespace bench
{

struct pose {
    std::string kind;
    double rotation[9], translation[3];
};

inline std::vector<pose> read_poses(const char *path)
{
    std::ifstream in(path);
    std::vector<pose> out;
    pose p;
    while (in >> p.kind) {
        for (double &x : p.rotation)
            in >> x;
        for (double &x : p.translation)
            in >> x;
        out.push_back(p);
    }
    return out;
}

// Returns the processor time of `times` calls in microseconds.
template <class Work> double time_of(int times, Work work)
{
    timespec a, b;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &a);
    for (int i = 0; i < times; i++)
        work();
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &b);
    return 1e6 * (double)(b.tv_sec - a.tv_sec) + 1e-3 * (double)(b.tv_nsec - a.tv_nsec);
}

// Returns the minimum time of one call in microseconds. A first call loads all data. Short calls
// are measured several at a time, because reading the clock takes time.
template <class Work> double least_time(int rounds, Work work)
{
    time_of(1, work);
    int times = std::max(1, static_cast<int>(100 / std::max(time_of(1, work), 1.0)));
    double least = INFINITY;
    for (int i = 0; i < rounds; i++)
        least = std::min(least, time_of(times, work) / times);
    return least;
}

using face_pairs = std::vector<std::pair<uint64_t, uint64_t>>;

// Writes the number of pairs, and the sorted pairs, little-endian.
inline void write_pairs(FILE *stream, face_pairs pairs)
{
    std::sort(pairs.begin(), pairs.end());
    uint64_t count = pairs.size();
    fwrite(&count, sizeof count, 1, stream);
    fwrite(pairs.data(), sizeof pairs[0], count, stream);
}

// Runs POSES QUERY ROUNDS [PAIRS]: prints the kind, microseconds and a value for each pose.
// run_query returns the value; for "all" it also fills the pairs.
template <class Query> int run_poses(char **argument, Query run_query)
{
    std::vector<pose> poses = read_poses(argument[0]);
    std::string query = argument[1];
    int rounds = atoi(argument[2]);
    FILE *stream = argument[3] ? fopen(argument[3], "wb") : nullptr;
    for (const pose &p : poses) {
        face_pairs pairs;
        double value = 0, us = least_time(rounds, [&] {
                              pairs.clear();
                              value = run_query(p, query, pairs);
                          });
        printf("%s %.3f %.17g\n", p.kind.c_str(), us, value);
        if (stream)
            write_pairs(stream, pairs);
    }
    if (stream)
        fclose(stream);
    return 0;
}

} // namespace bench
#endif
