/* Candidate normals of a gray node: those of the faces below it; where there are many, the mean of
 * each occupied bin of the octahedral map, with bins no finer than needed. */
#include "construct/candidates.h"

#include <stdlib.h>
#include <string.h>

#include "core/hash.h"

/* Every `step`-th of the entries, or of the branch's whole list. */
static void sample_faces(const ebpo_builder *b, const ebpo_branch *s, const uint32_t *entries,
                         uint64_t begin, uint64_t end, uint64_t *skip, uint64_t step,
                         uint32_t *sample, int *count)
{
    uint64_t i = begin + *skip;
    for (; i < end; i += step) {
        ebpo_triangle face;
        uint32_t normal;
        if (step > 64 &&
            *count % 16 == 0) /* each is in a different part of the workspace's files */
            ebpo_release_pages(b->workspace);
        ebpo_branch_triangle(b, s, entries ? entries[i] : (uint32_t)i, &face);
        if (*count < EBPO_CANDIDATES_SAMPLE && ebpo_face_normal_code(&b->box, &face, &normal))
            sample[(*count)++] = normal;
    }
    *skip = i - end;
}

static int take_sample(const ebpo_builder *b, const ebpo_branch *s, const ebpo_build_detail *d,
                       uint32_t *sample)
{
    int count = 0;
    uint64_t skip = 0, total = 0;
    if (s->list) {
        uint64_t step = (d->entry_end - d->entry_begin) / EBPO_CANDIDATES_SAMPLE + 1;
        sample_faces(b, s, s->entries, d->entry_begin, d->entry_end, &skip, step, sample, &count);
        return count;
    }
    for (uint64_t i = d->entry_begin; i < d->entry_end; i++)
        total += b->sub[i].list_count;
    for (uint64_t i = d->entry_begin; i < d->entry_end; i++)
        sample_faces(b, &b->sub[i], NULL, 0, b->sub[i].list_count, &skip,
                     total / EBPO_CANDIDATES_SAMPLE + 1, sample, &count);
    return count;
}

/* Fills the table with bins of `width` codes; false when more than `most` are occupied. */
static bool fill_bins(ebpo_normal_bin *table, int *used, int *slots, const uint32_t *sample,
                      int count, uint32_t width, int most)
{
    for (int i = 0; i < *used; i++)
        table[slots[i]].key = 0;
    *used = 0;
    for (int i = 0; i < count; i++) {
        uint32_t u = sample[i] & 1023, v = sample[i] >> 10 & 1023,
                 key = 1 + u / width + (v / width << 10);
        uint64_t at;
        EBPO_HASH_FIND(at, ebpo_hash_number(key), EBPO_CANDIDATES_BINS - 1,
                       !table[at].key || table[at].key == key);
        if (!table[at].key) {
            if (*used == most)
                return false;
            table[at] = (ebpo_normal_bin){ key, 0, 0, 0 };
            slots[(*used)++] = (int)at;
        }
        table[at].count++;
        table[at].sum_u += u;
        table[at].sum_v += v;
    }
    return true;
}

int ebpo_build_candidates(const ebpo_builder *b, ebpo_candidates_scratch *scratch,
                          const ebpo_branch *s, const ebpo_build_detail *detail, int most,
                          ebpo_candidate *out)
{
    ebpo_normal_bin *table = scratch->table;
    int used = 0, count = take_sample(b, s, detail, scratch->sample);
    uint32_t width = 1;
    while (!fill_bins(table, &used, scratch->slots, scratch->sample, count, width, most))
        width = width < 4 ? 4 : width + width / 2;
    for (int i = 0; i < used; i++) {
        ebpo_normal_bin *t = &table[scratch->slots[i]];
        uint32_t u = (uint32_t)((t->sum_u + t->count / 2) / t->count),
                 v = (uint32_t)((t->sum_v + t->count / 2) / t->count);
        out[i] = (ebpo_candidate){ .normal = u | v << 10, .support = -1e300 };
        t->key = 0;
    }
    return used;
}
