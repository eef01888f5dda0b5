/* Makes the mesh of the result of an expression. First lists the faces of the operands that are cut
 * (face_list.h), and cuts these faces along their intersections (cut_mesh.h). Then selects the
 * parts that bound the result, and joins them with the faces that are not cut (result_mesh.h). Only
 * the last step rounds. Rounding moves vertices, but does not change which triangles share them, so
 * the mesh is closed. Proof: docs/develop/booleans.md, "Mesh". */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "core/error.h"
#include "core/fp_env.h"
#include "extras/boolean/result_mesh.h"

static ebpo_status make_mesh(ebpo_face_list *faces, const ebpo_boolean_mesh_options *options,
                             ebpo_mesh *mesh, ebpo_boolean_mesh_report *report, ebpo_error *error)
{
    ebpo_cut_mesh cut;
    int8_t *sign = NULL;
    ebpo_status status = ebpo_cut_mesh_make(&cut, faces, &options->progress, error);
    if (status == EBPO_OK)
        status = ebpo_cut_mesh_classify(&cut, &options->progress, &sign, &report->patches, error);
    if (status == EBPO_OK)
        status = ebpo_result_mesh_make(&cut, sign, options, mesh, report, error);
    report->faces_cut = cut.faces_cut;
    free(sign);
    ebpo_cut_mesh_free(&cut);
    return status;
}

ebpo_status ebpo_boolean_mesh(ebpo_boolean *boolean, const ebpo_boolean_mesh_options *options,
                              ebpo_mesh *out, ebpo_boolean_mesh_report *report, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_boolean_mesh_options checked = EBPO_BOOLEAN_MESH_OPTIONS_INIT;
    ebpo_boolean_mesh_report filled = EBPO_BOOLEAN_MESH_REPORT_INIT;
    ebpo_face_list faces;
    memset(out, 0, sizeof *out);
    ebpo_status status = EBPO_TAKE(ebpo_boolean_mesh_options, &checked, options, error);
    if (status == EBPO_OK && checked.changed_only && (checked.volume || checked.attributes))
        status = ebpo_fail(error, EBPO_E_ARGUMENT,
                           "changed_only cannot be used with volume or attributes");
    if (status != EBPO_OK)
        return status;
    status = ebpo_face_list_make(&faces, boolean, checked.changed_only, checked.workspace,
                                 &checked.progress, error);
    if (status == EBPO_OK)
        status = make_mesh(&faces, &checked, out, &filled, error);
    ebpo_face_list_free(&faces);
    if (status != EBPO_OK)
        ebpo_mesh_free(out);
    return status == EBPO_OK && report ? EBPO_GIVE(ebpo_boolean_mesh_report, report, &filled)
                                       : status;
}
