// The public headers from C++, and the shared library's public symbols only.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include <ebpo/boolean.h>
#include <ebpo/collide.h>
#include <ebpo/ebpo.h>
#include <ebpo/map.h>
#include <ebpo/paint.h>
#include <ebpo/scene.h>
#include <ebpo/haptic.h>

int main()
{
    char version[32];
    std::snprintf(version, sizeof version, "%d.%d.%d", EBPO_VERSION_MAJOR, EBPO_VERSION_MINOR,
                  EBPO_VERSION_PATCH);
    if (std::strcmp(version, ebpo_version()) != 0 || ebpo_version_number() != EBPO_VERSION_NUMBER ||
        EBPO_VERSION_NUMBER < EBPO_VERSION_OF(0, 1, 0))
        return 2;
    ebpo_file_stats stats = EBPO_FILE_STATS_INIT;
    if (stats.struct_size != sizeof stats || stats.reads != 0)
        return 3;
    ebpo_mesh mesh = {};
    mesh.vertex_count = 4;
    mesh.face_count = 4;
    mesh.xyz32 = static_cast<float *>(std::calloc(12, sizeof(float)));
    mesh.faces = static_cast<std::uint32_t *>(std::malloc(12 * sizeof(std::uint32_t)));
    const std::uint32_t faces[12] = { 0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2 };
    for (int i = 0; i < 12; i++)
        mesh.faces[i] = faces[i];
    mesh.xyz32[3] = mesh.xyz32[7] = mesh.xyz32[11] = 1;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh_report report;
    if (ebpo_mesh_check(&mesh, 1, ebpo_progress(), &report, &error) != EBPO_OK || !report.balanced)
        return 1;
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    ebpo_tree tree;
    if (ebpo_build(&mesh, &report, nullptr, &options, &tree, &error) != EBPO_OK) {
        std::puts(error.message);
        return 1;
    }
    std::printf("%s: %d levels, volume %g\n", ebpo_version(), tree.info.level_count,
                tree.info.report.volume);
    ebpo_tree_free(&tree);
    return 0;
}
