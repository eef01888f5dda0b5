// CGAL as a peer: one thread, EPICK (exact predicates, constructions in double).
//
// inside: Side_of_triangle_mesh. distance: closest_point_and_primitive with the accelerating point
// tree. ray: first_intersection.
#include <CGAL/AABB_face_graph_triangle_primitive.h>
#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Side_of_triangle_mesh.h>
#include <CGAL/Surface_mesh.h>

#include <cmath>
#include <memory>

#include "peer.hpp"

namespace
{

using kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using point_3 = kernel::Point_3;

// ---- inside ----

class inside : public bench::standard
{
  public:
    static constexpr const char *name = "cgal";
    static constexpr int doubles = 3;
    using result_type = uint8_t;

    void begin(const bench::job &) {}

    void load(const char *path)
    {
        bench::mesh<double> mesh = bench::read_ply<double>(path);
        size_t vertices = mesh.xyz.size() / 3, faces = mesh.corners.size() / 3;
        surface.reserve(vertices, 3 * faces / 2, faces);
        for (size_t i = 0; i < vertices; i++)
            surface.add_vertex(point_3(mesh.xyz[3 * i], mesh.xyz[3 * i + 1], mesh.xyz[3 * i + 2]));
        for (size_t i = 0; i < faces; i++) {
            auto vertex = [&](size_t corner) {
                return surface_mesh::Vertex_index(mesh.corners[3 * i + corner]);
            };
            if (surface.add_face(vertex(0), vertex(1), vertex(2)) == surface_mesh::null_face())
                throw std::runtime_error("CGAL's Surface_mesh needs a manifold mesh");
        }
        if (!CGAL::is_closed(surface))
            throw std::runtime_error("the mesh is not closed");
    }

    void build()
    {
        tree.insert(faces(surface).first, faces(surface).second, surface);
        tree.build();
        side = std::make_unique<CGAL::Side_of_triangle_mesh<surface_mesh, kernel>>(tree);
    }

    // Points on the surface count as inside.
    uint8_t result(const double *p)
    {
        return (*side)(point_3(p[0], p[1], p[2])) != CGAL::ON_UNBOUNDED_SIDE;
    }

  private:
    using surface_mesh = CGAL::Surface_mesh<point_3>;
    using primitive = CGAL::AABB_face_graph_triangle_primitive<surface_mesh>;
    surface_mesh surface;
    CGAL::AABB_tree<CGAL::AABB_traits<kernel, primitive>> tree;
    std::unique_ptr<CGAL::Side_of_triangle_mesh<surface_mesh, kernel>> side;
};

// ---- distance and rays: on a list of triangles, which is faster than on a connected mesh ----

using triangle_list = std::vector<kernel::Triangle_3>;
using triangle_primitive = CGAL::AABB_triangle_primitive<kernel, triangle_list::const_iterator>;
using triangle_tree = CGAL::AABB_tree<CGAL::AABB_traits<kernel, triangle_primitive>>;

triangle_list read_triangles(const char *path)
{
    bench::mesh<double> mesh = bench::read_ply<double>(path);
    triangle_list out;
    out.reserve(mesh.corners.size() / 3);
    auto vertex = [&](size_t corner) {
        const double *p = &mesh.xyz[3 * (size_t)mesh.corners[corner]];
        return point_3(p[0], p[1], p[2]);
    };
    for (size_t i = 0; i < mesh.corners.size(); i += 3)
        out.emplace_back(vertex(i), vertex(i + 1), vertex(i + 2));
    return out;
}

class distance : public bench::standard
{
  public:
    static constexpr const char *name = "cgal";
    static constexpr int doubles = 3;
    using result_type = bench::hit;

    void begin(const bench::job &job) { warm = job.warm; }
    void load(const char *path) { triangles = read_triangles(path); }

    void build()
    {
        tree.rebuild(triangles.cbegin(), triangles.cend());
        tree.build();
        tree.accelerate_distance_queries();
        last.second = triangles.cend();
    }

    bench::hit result(const double *p)
    {
        point_3 query(p[0], p[1], p[2]);
        bool hint = warm && last.second != triangles.cend();
        last = hint ? tree.closest_point_and_primitive(query, last)
                    : tree.closest_point_and_primitive(query);
        return { std::sqrt(CGAL::squared_distance(query, last.first)),
                 last.second - triangles.cbegin() };
    }

  private:
    bool warm = false;
    triangle_list triangles;
    triangle_tree tree;
    triangle_tree::Point_and_primitive_id last;
};

class first_hit : public bench::standard
{
  public:
    static constexpr const char *name = "cgal";
    static constexpr int doubles = 6;
    using result_type = bench::hit;

    void begin(const bench::job &job)
    {
        if (job.query != "ray")
            throw std::runtime_error("this peer does not support " + job.query);
    }
    void load(const char *path) { triangles = read_triangles(path); }

    void build()
    {
        tree.rebuild(triangles.cbegin(), triangles.cend());
        tree.build();
    }

    bench::hit result(const double *r)
    {
        point_3 origin(r[0], r[1], r[2]);
        kernel::Vector_3 direction(r[3], r[4], r[5]);
        auto found = tree.first_intersection(kernel::Ray_3(origin, direction));
        if (!found)
            return { INFINITY, -1 };
        double t = INFINITY;
        auto along = [&](const point_3 &p) {
            return (p - origin) * direction / direction.squared_length();
        };
        if (const point_3 *point = boost::get<point_3>(&found->first))
            t = along(*point);
        else if (const kernel::Segment_3 *segment = boost::get<kernel::Segment_3>(&found->first))
            t = std::min(along(segment->source()), along(segment->target()));
        return { t, found->second - triangles.cbegin() };
    }

  private:
    triangle_list triangles;
    triangle_tree tree;
};

} // namespace

int main(int argc, char **argv) { return bench::main<inside, distance, first_hit>(argc, argv); }
