/* NRRD: a header of text and raw numbers. Source: teem, "Definition of NRRD File Format". */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <string.h>

#include "core/endian.h"
#include "core/error.h"
#include "extras/map/map_file.h"

static void put_vector(FILE *to, const double v[3])
{
    fprintf(to, " (%.17g,%.17g,%.17g)", v[0], v[1], v[2]);
}

ebpo_status ebpo_map_nrrd_begin(ebpo_map_file *f, ebpo_error *error)
{
    const ebpo_lattice *l = f->lattice;
    FILE *to = f->stream;
    fprintf(to, "NRRD0004\n# signed distances of a model, as ebpo map writes them\ntype: double\n"
                "dimension: 3\nspace dimension: 3\n");
    fprintf(to, "sizes: %" PRIu64 " %" PRIu64 " %" PRIu64 "\n", l->count[0], l->count[1],
            l->count[2]);
    fprintf(to, "space directions:");
    for (int i = 0; i < 3; i++)
        put_vector(to, l->step[i]);
    fprintf(to, "\nspace origin:");
    put_vector(to, l->origin);
    fprintf(to, "\nkinds: space space space\ncenterings: node node node\nendian: little\n"
                "encoding: raw\n\n");
    return ferror(to) ? ebpo_fail_errno(error, f->shown, "writing the header") : EBPO_OK;
}

ebpo_status ebpo_map_nrrd_layers(ebpo_map_file *f, const double *values, uint64_t first,
                                 uint64_t layers, ebpo_error *error)
{
    uint64_t count = layers * f->lattice->count[0] * f->lattice->count[1];
    (void)first; /* they come in order */
    for (uint64_t i = 0; i < count;) {
        uint8_t bytes[8 * 512];
        unsigned n = 0;
        for (; n < 512 && i < count; n++, i++) {
            uint64_t bits;
            memcpy(&bits, &values[i], sizeof bits);
            ebpo_store64(bytes + 8 * n, bits);
        }
        if (fwrite(bytes, 8, n, f->stream) != n)
            return ebpo_fail_errno(error, f->shown, "writing");
    }
    return EBPO_OK;
}
