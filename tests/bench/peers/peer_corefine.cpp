// CGAL's corefinement as a peer: peer_corefine A.ply B.ply OPERATOR POSE OUT.off computes A | B, A
// & B or A - B of closed meshes. POSE: the twelve numbers of B's matrix [R t], by rows. Predicates
// are exact, constructions are doubles (EPICK); one thread. Prints the number of faces.
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/corefinement.h>
#include <CGAL/Surface_mesh.h>

#include <fstream>
#include <iostream>
#include <sstream>

#include "peer.hpp"

namespace
{

using kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using surface_mesh = CGAL::Surface_mesh<kernel::Point_3>;
namespace processing = CGAL::Polygon_mesh_processing;

surface_mesh read(const char *path, const std::vector<double> &pose)
{
    bench::mesh<double> from = bench::read_ply<double>(path);
    size_t vertices = from.xyz.size() / 3, faces = from.corners.size() / 3;
    surface_mesh out;
    out.reserve(vertices, 3 * faces / 2, faces);
    for (size_t v = 0; v < vertices; v++) {
        const double *x = &from.xyz[3 * v];
        double y[3];
        for (size_t i = 0; i < 3; i++) {
            const double *m = &pose[4 * i];
            y[i] = ((m[0] * x[0] + m[1] * x[1]) + m[2] * x[2]) + m[3];
        }
        out.add_vertex(kernel::Point_3(y[0], y[1], y[2]));
    }
    for (size_t f = 0; f < faces; f++) {
        auto corner = [&](size_t i) { return surface_mesh::Vertex_index(from.corners[3 * f + i]); };
        if (out.add_face(corner(0), corner(1), corner(2)) == surface_mesh::null_face())
            throw std::runtime_error("CGAL's Surface_mesh needs a manifold mesh");
    }
    return out;
}

} // namespace

int main(int argc, char **argv)
{
    if (argc != 6)
        return 2;
    std::vector<double> still = { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0 }, pose;
    std::istringstream numbers(argv[4]);
    for (double x; numbers >> x;)
        pose.push_back(x);
    surface_mesh a = read(argv[1], still), b = read(argv[2], pose), out;
    bool fine = *argv[3] == '|'   ? processing::corefine_and_compute_union(a, b, out)
                : *argv[3] == '&' ? processing::corefine_and_compute_intersection(a, b, out)
                                  : processing::corefine_and_compute_difference(a, b, out);
    std::ofstream file(argv[5]);
    file.precision(9);
    if (!fine || !CGAL::IO::write_OFF(file, out))
        return 1;
    std::cout << num_faces(out) << "\n";
    return 0;
}
