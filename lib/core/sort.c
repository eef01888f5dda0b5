/* Sorts records in three passes. The records may be larger than the memory. The first pass makes
 * the records and counts them by the leading bits of their keys. The second pass makes them again,
 * because storing them would take longer if they are in a file, and distributes them to groups by
 * these bits. The third pass sorts each group in memory, by the digits of the keys; the caller's
 * comparison orders records with equal keys. A pass writes and reads the array of groups in each
 * group from the group's begin to its end. With such sequential access, a workspace can keep this
 * array in a file. The result depends neither on the number of threads nor on memory. */
#include "core/sort.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"

enum {
    GROUP = 1 << 16, /* least number of records in a group; this number fits in a core's cache */
    LARGE_GROUP = 4 * GROUP, /* groups with more records are sorted in arrays of the workspace */
    /* approximate maximum number of groups; limited, because the second pass writes to all groups
     * at the same time */
    GROUPS_MAX = 1024,
    GRAIN = 1 << 13,     /* number of records that a thread takes at a time */
    DIGIT = 256,         /* number of values of a digit of a key */
    ALONE_MAX = 1 << 12, /* up to this number, all records are sorted as one group */
    RELEASE_EVERY = 4    /* pages are released after this number of copies to groups */
};

/* State of a sort. A bin is a value of the leading bits of a key. */
typedef struct sorting {
    const ebpo_sort *s;
    uint8_t *dealt;     /* records in the order of their groups */
    uint64_t *first;    /* [groups + 1] first record of each group in `dealt` */
    uint64_t *next;     /* [groups] position in `dealt` of the group's next records */
    uint32_t *group_of; /* [EBPO_SORT_BINS] group of each bin */
    uint64_t *in_bin;   /* [EBPO_SORT_BINS] number of records in each bin */
    uint64_t groups;
} sorting;

static uint64_t key_of(const uint8_t *record)
{
    uint64_t key;
    memcpy(&key, record, sizeof key);
    return key;
}

/* Allocates memory for the records [begin, end), and makes them. The caller must free *out. */
static ebpo_status make_some(const ebpo_sort *s, uint64_t begin, uint64_t end, uint8_t **out,
                             ebpo_error *error)
{
    *out = ebpo_alloc(end - begin, s->record);
    return *out ? s->make(s->context, begin, end, *out, error)
                : ebpo_fail_memory(error, (end - begin) * s->record);
}

static ebpo_status count_records(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    sorting *t = context;
    const ebpo_sort *s = t->s;
    (void)worker;
    uint8_t *made;
    ebpo_status status = make_some(s, begin, end, &made, error);
    for (uint64_t i = 0; i < end - begin && status == EBPO_OK; i++)
        __atomic_fetch_add(&t->in_bin[key_of(made + i * s->record) >> s->shift], 1,
                           __ATOMIC_RELAXED);
    free(made);
    return status;
}

/* Forms groups of neighbouring bins. Each group has at least `enough` records, except the last
 * group. Returns false when out of memory. */
static bool form_groups(sorting *t)
{
    uint64_t enough = t->s->count / GROUPS_MAX > GROUP ? t->s->count / GROUPS_MAX : GROUP,
             capacity = 0, sum = 0;
    t->groups = 0;
    for (uint32_t bin = 0; bin < EBPO_SORT_BINS; bin++) {
        t->group_of[bin] = (uint32_t)t->groups;
        sum += t->in_bin[bin];
        if (sum < enough && bin + 1 < EBPO_SORT_BINS)
            continue;
        if (!ebpo_grow(&t->first, &capacity, t->groups + 2, sizeof *t->first))
            return false;
        if (t->groups == 0)
            t->first[0] = 0;
        t->first[t->groups + 1] = t->first[t->groups] + sum;
        t->groups++;
        sum = 0;
    }
    t->next = ebpo_alloc(t->groups, sizeof *t->next);
    if (t->next)
        memcpy(t->next, t->first, (size_t)t->groups * sizeof *t->next);
    return t->next != NULL;
}

/* Makes the records [begin, end) and distributes them to the groups. First copies the records to
 * `grouped`, ordered by group; `grouped` fits in the core's cache. Then copies the records of each
 * group to `dealt` with one memcpy. So a thread writes to `dealt` at only one position at a time.
 */
static ebpo_status deal_to_groups(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                  ebpo_error *error)
{
    sorting *t = context;
    const ebpo_sort *s = t->s;
    /* cursor[g] belongs to group g and has two meanings. The first loop counts the group's records
     * in [begin, end). The second loop replaces the counts by positions: cursor[g] becomes the
     * index in `grouped` for the group's next record. There can be slightly more than GROUPS_MAX
     * groups, because form_groups rounds the size of groups down. */
    uint64_t cursor[GROUPS_MAX * 2], at = 0;
    (void)worker;
    memset(cursor, 0, (size_t)t->groups * sizeof *cursor);
    uint8_t *made, *grouped = ebpo_alloc(end - begin, s->record);
    ebpo_status status = make_some(s, begin, end, &made, error);
    if (status == EBPO_OK && !grouped)
        status = ebpo_fail_memory(error, (end - begin) * s->record);
    if (status != EBPO_OK) {
        free(made);
        free(grouped);
        return status;
    }
    const uint8_t *from = made;
    for (uint64_t i = begin; i < end; i++, from += s->record)
        cursor[t->group_of[key_of(from) >> s->shift]]++;
    for (uint64_t g = 0; g < t->groups; g++) {
        uint64_t count = cursor[g];
        cursor[g] = at;
        at += count;
    }
    from = made;
    for (uint64_t i = begin; i < end; i++, from += s->record)
        memcpy(grouped + cursor[t->group_of[key_of(from) >> s->shift]]++ * s->record, from,
               s->record);
    for (uint64_t g = 0, first = 0, runs = 0; g < t->groups; first = cursor[g++]) {
        uint64_t count = cursor[g] - first;
        if (count == 0)
            continue;
        uint64_t place = __atomic_fetch_add(&t->next[g], count, __ATOMIC_RELAXED);
        memcpy(t->dealt + place * s->record, grouped + first * s->record,
               (size_t)count * s->record);
        if (++runs % RELEASE_EVERY == 0)
            ebpo_release_pages(s->workspace);
    }
    free(made);
    free(grouped);
    return EBPO_OK;
}

/* --- groups --- */

/* The key of a record, and the record's index in its group. */
typedef struct keyed {
    uint64_t key;
    uint64_t at;
} keyed;

/* Sorts by the bytes of the keys, from the lowest byte to the highest. Keeps the order of equal
 * keys. Skips a byte position if all keys have the same byte there. `to`: memory for `count` items.
 * Returns the sorted array: `from` or `to`. */
static keyed *sort_by_digits(keyed *from, keyed *to, uint64_t count)
{
    uint64_t all = ~UINT64_C(0), any = 0;
    for (uint64_t i = 0; i < count; i++) {
        all &= from[i].key;
        any |= from[i].key;
    }
    for (int shift = 0; shift < 64; shift += 8) {
        if (!((all ^ any) >> shift & (DIGIT - 1)))
            continue;
        uint64_t start[DIGIT] = { 0 }, sum = 0;
        for (uint64_t i = 0; i < count; i++)
            start[from[i].key >> shift & (DIGIT - 1)]++;
        for (int d = 0; d < DIGIT; d++) {
            uint64_t n = start[d];
            start[d] = sum;
            sum += n;
        }
        for (uint64_t i = 0; i < count; i++)
            to[start[from[i].key >> shift & (DIGIT - 1)]++] = from[i];
        keyed *swap = from;
        from = to;
        to = swap;
    }
    return from;
}

/* Sorts the records [begin, end), which have equal keys, by the caller's comparison. Up to FEW
 * records are sorted by insertion. */
static void break_ties(const ebpo_sort *s, uint8_t *records, uint64_t begin, uint64_t end)
{
    enum { FEW = 16 };
    uint8_t inserted[EBPO_SORT_RECORD_MAX];
    if (end - begin > FEW) {
        qsort(records + begin * s->record, (size_t)(end - begin), s->record, s->compare);
        return;
    }
    for (uint64_t i = begin + 1; i < end; i++) {
        memcpy(inserted, records + i * s->record, s->record);
        uint64_t j = i;
        for (; j > begin && s->compare(inserted, records + (j - 1) * s->record) < 0; j--)
            memcpy(records + j * s->record, records + (j - 1) * s->record, s->record);
        memcpy(records + j * s->record, inserted, s->record);
    }
}

/* Sorts the records of group g, and passes them to the caller. */
static ebpo_status sort_group(const sorting *t, uint64_t g, ebpo_error *error)
{
    const ebpo_sort *s = t->s;
    uint64_t count = t->first[g + 1] - t->first[g];
    const uint8_t *group = t->dealt + t->first[g] * s->record;
    /* A group has more than LARGE_GROUP records if there are more than GROUPS_MAX * LARGE_GROUP
     * records in total, or if many records have equal leading bits. Such a group may exceed memory.
     */
    ebpo_workspace *storage = count > LARGE_GROUP ? s->workspace : NULL;
    keyed *keys = ebpo_array_alloc(storage, 2 * count, sizeof *keys);
    uint8_t *sorted = ebpo_array_alloc(storage, count, s->record);
    ebpo_status status = EBPO_OK;
    if (!keys || !sorted)
        status = ebpo_workspace_fail(storage, count * (2 * sizeof *keys + s->record), error);
    else {
        for (uint64_t i = 0; i < count; i++)
            keys[i] = (keyed){ key_of(group + i * s->record), i };
        keyed *order = sort_by_digits(keys, keys + count, count);
        for (uint64_t i = 0; i < count; i++)
            memcpy(sorted + i * s->record, group + order[i].at * s->record, s->record);
        for (uint64_t i = 0, end; i < count; i = end) {
            for (end = i + 1; end < count && order[end].key == order[i].key; end++)
                ;
            break_ties(s, sorted, i, end);
        }
        s->take(s->context, t->first[g], sorted, count);
    }
    ebpo_array_free(storage, keys);
    ebpo_array_free(storage, sorted);
    return status;
}

static ebpo_status sort_groups(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    sorting *t = context;
    (void)worker;
    ebpo_status status = EBPO_OK;
    for (uint64_t g = begin; g < end && status == EBPO_OK; g++) {
        status = sort_group(t, g, error);
    }
    return status;
}

/* Sorts at most ALONE_MAX records as one group, without bins or threads. */
static ebpo_status run_alone(sorting *t, ebpo_error *error)
{
    const ebpo_sort *s = t->s;
    uint64_t whole[2] = { 0, s->count };
    if (!ebpo_progress_stage(s->progress, s->stage, error))
        return EBPO_E_CANCELLED;
    t->dealt = ebpo_alloc(s->count, s->record);
    if (!t->dealt)
        return ebpo_fail_memory(error, s->count * s->record);
    ebpo_status status = s->make(s->context, 0, s->count, t->dealt, error);
    t->first = whole;
    if (status == EBPO_OK && s->count)
        status = sort_group(t, 0, error);
    t->first = NULL;
    return status;
}

/* Returns the number of threads that sort groups. Each thread has one group in memory, and all
 * threads together use at most an eighth of the budget. If one group takes more than this, a single
 * thread sorts the groups. */
static unsigned threads_for_groups(const sorting *t)
{
    const ebpo_sort *s = t->s;
    ebpo_workspace_stats usage = EBPO_WORKSPACE_STATS_INIT;
    usage.memory = UINT64_MAX;
    uint64_t largest = 1;
    if (s->workspace)
        ebpo_workspace_get_stats(s->workspace, &usage);
    for (uint64_t g = 0; g < t->groups; g++)
        largest = t->first[g + 1] - t->first[g] > largest ? t->first[g + 1] - t->first[g] : largest;
    uint64_t fit =
        usage.memory / 8 /
        ((largest < LARGE_GROUP ? largest : LARGE_GROUP) * (2 * sizeof(keyed) + s->record));
    return fit < 1 ? 1 : s->threads < fit ? s->threads : (unsigned)fit;
}

static ebpo_status run_passes(sorting *t, ebpo_error *error)
{
    const ebpo_sort *s = t->s;
    ebpo_pass pass = { s->progress, s->passes_before, s->passes_before + 1,
                       s->passes_before + EBPO_SORT_PASSES };
    ebpo_progress progress = ebpo_pass_progress(&pass);
    ebpo_status status = ebpo_parallel_for(s->threads, s->workspace, s->count, GRAIN, count_records,
                                           t, &progress, s->stage, error);
    pass.begin = pass.end++;
    if (status == EBPO_OK && !form_groups(t))
        status = ebpo_fail_memory(error, 0);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(s->threads, s->workspace, s->count, GRAIN, deal_to_groups, t,
                                   &progress, s->stage, error);
    pass.begin = pass.end++;
    if (status == EBPO_OK)
        status = ebpo_parallel_for(threads_for_groups(t), s->workspace, t->groups, 1, sort_groups,
                                   t, &progress, s->stage, error);
    return status;
}

ebpo_status ebpo_sort_run(const ebpo_sort *sort, ebpo_error *error)
{
    if (sort->record > EBPO_SORT_RECORD_MAX)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "records of %zu bytes are too large to sort",
                         sort->record);
    sorting t = { .s = sort };
    if (sort->count <= ALONE_MAX) {
        ebpo_status status = run_alone(&t, error);
        free(t.dealt);
        return status;
    }
    t.dealt = ebpo_array_alloc(sort->workspace, sort->count, sort->record);
    t.group_of = ebpo_alloc(EBPO_SORT_BINS, sizeof *t.group_of);
    t.in_bin = ebpo_alloc_zero(EBPO_SORT_BINS, sizeof *t.in_bin);
    ebpo_status status =
        t.dealt && t.group_of && t.in_bin
            ? run_passes(&t, error)
            : ebpo_workspace_fail(sort->workspace, sort->count * sort->record, error);
    ebpo_array_free(sort->workspace, t.dealt);
    free(t.first);
    free(t.next);
    free(t.group_of);
    free(t.in_bin);
    return status;
}

static int compare_numbers(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

void ebpo_sort_numbers(uint64_t *numbers, uint64_t count)
{
    if (count > 32) {
        qsort(numbers, count, sizeof *numbers, compare_numbers);
        return;
    }
    for (uint64_t i = 1; i < count; i++) {
        uint64_t number = numbers[i], at = i;
        for (; at > 0 && numbers[at - 1] > number; at--)
            numbers[at] = numbers[at - 1];
        numbers[at] = number;
    }
}
