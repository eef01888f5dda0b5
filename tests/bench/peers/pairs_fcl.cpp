// Queries contacts and distances with FCL: trees of OBBRSS in doubles, as in its examples.
//
//     pairs_fcl MODEL.ply POSES QUERY ROUNDS [PAIRS]     QUERY: first, all, distance
#include <fcl/fcl.h>
#include <malloc.h>

#include "pairs.hpp"

using tree = fcl::BVHModel<fcl::OBBRSSd>;

static std::shared_ptr<tree> make_tree(const bench::mesh<double> &m)
{
    std::vector<fcl::Vector3d> vertices(m.xyz.size() / 3);
    std::vector<fcl::Triangle> faces(m.corners.size() / 3);
    for (size_t i = 0; i < vertices.size(); i++)
        vertices[i] = fcl::Vector3d(m.xyz[3 * i], m.xyz[3 * i + 1], m.xyz[3 * i + 2]);
    for (size_t i = 0; i < faces.size(); i++)
        faces[i].set(m.corners[3 * i], m.corners[3 * i + 1], m.corners[3 * i + 2]);
    auto out = std::make_shared<tree>();
    out->beginModel(static_cast<int>(faces.size()), static_cast<int>(vertices.size()));
    out->addSubModel(vertices, faces);
    out->endModel();
    return out;
}

static fcl::Transform3d transform_of(const bench::pose &p)
{
    fcl::Transform3d out = fcl::Transform3d::Identity();
    for (int i = 0; i < 9; i++)
        out.linear()(i / 3, i % 3) = p.rotation[i];
    for (int i = 0; i < 3; i++)
        out.translation()[i] = p.translation[i];
    return out;
}

static double run_query(const tree &t, const bench::pose &p, const std::string &query,
                        bench::face_pairs &pairs)
{
    fcl::Transform3d here = fcl::Transform3d::Identity(), there = transform_of(p);
    if (query == "distance") {
        fcl::DistanceRequestd request(true, false);
        fcl::DistanceResultd result;
        return fcl::distance(&t, here, &t, there, request, result);
    }
    fcl::CollisionRequestd request(query == "first" ? 1 : std::numeric_limits<size_t>::max(),
                                   false);
    fcl::CollisionResultd result;
    fcl::collide(&t, here, &t, there, request, result);
    std::vector<fcl::Contactd> contacts;
    result.getContacts(contacts);
    for (const fcl::Contactd &c : contacts)
        pairs.emplace_back(c.b1, c.b2);
    return static_cast<double>(contacts.size());
}

static size_t allocated()
{
    struct mallinfo2 all = mallinfo2();
    return all.uordblks + all.hblkhd;
}

int main(int count, char **argument)
{
    if (count < 5)
        return 2;
    bench::mesh<double> m = bench::read_ply<double>(argument[1]);
    std::shared_ptr<tree> t;
    timespec a, b;
    size_t before = allocated();
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &a);
    t = make_tree(m);
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &b);
    double build = (double)(b.tv_sec - a.tv_sec) + 1e-9 * (double)(b.tv_nsec - a.tv_nsec);
    printf("made %.3f %zu\n", build, allocated() - before);
    return bench::run_poses(argument + 2, [&](const bench::pose &p, const std::string &query,
                                              bench::face_pairs &pairs) {
        return run_query(*t, p, query, pairs);
    });
}
