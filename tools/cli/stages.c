/* Prints the times of the stages of a build. A row is a stage as users see it; it sums several
 * stages of the library. */
#include "cli/stages.h"

#include <string.h>

#include "cli/words.h"

static const char *const thesis_names[THESIS_STAGES + 1] = {
    "leaf creation", "corner labels",           "leaf planes", "tree paths",
    "leaf clipping", "storing and propagating", "total"
};

/* Returns the stages of the thesis that do the work of a row, as bits. */
static unsigned thesis_bits(stage_row row, const stage_facts *f)
{
    bool makes_leaf_planes = row == STAGE_ENVELOPES && f->leaf_planes && !f->from_leaves;
    return stage_names[row].thesis | (makes_leaf_planes ? THESIS_LEAF_PLANES | THESIS_CLIPPING : 0);
}

int stages_plan(const stage_facts *f, int plan[STAGE_PLAN_MAX])
{
    int n = 0;
    for (int r = 0; r < STAGE_OTHER; r++) {
        bool omitted = (r == STAGE_REPAIR && !f->may_repair) || (r == STAGE_CORNERS && !f->solid) ||
                       r == STAGE_CELLS || /* stages_split adds this row */
                       (r == STAGE_CHOOSING && !f->from_leaves) ||
                       (r == STAGE_SELECTING && !f->selected);
        if (r == STAGE_REPAIR && f->may_repair) {
            plan[n++] = STAGE_ORDERING;
            plan[n++] = STAGE_CHECKING;
        }
        if (!omitted)
            plan[n++] = r;
    }
    if (f->selected)
        plan[n++] = STAGE_WRITING;
    return n;
}

void stages_split(progress_line *line, const ebpo_build_times *times)
{
    int at = 0;
    double step_seconds = times->cells + times->envelopes;
    for (int i = 0; i < line->stage_count; i++) {
        if (strcmp(line->stages[i].name, "envelopes") == 0)
            at = i;
    }
    if (at == 0 || !(step_seconds > 0) || line->stage_count == PROGRESS_STAGES)
        return;
    memmove(&line->stages[at + 1], &line->stages[at],
            (size_t)(line->stage_count - at) * sizeof *line->stages);
    line->stage_count++;
    line->stages[at].name = "cells";
    line->stages[at].seconds *= times->cells / step_seconds;
    line->stages[at + 1].seconds -= line->stages[at].seconds;
}

/* --- words --- */

/* Prints the name, the seconds and the faces per second of a row. */
static void print_row(FILE *out, const char *name, double seconds, uint64_t faces)
{
    char rate[32] = "";
    if (seconds >= 0.005)
        words_count(rate, sizeof rate, (double)faces / seconds);
    fprintf(out, "  %-10s%9.2f%10s  ", name, seconds, rate);
}

static void print_thesis(FILE *out, unsigned thesis)
{
    const char *between = "";
    for (int i = 0; i < THESIS_STAGES; i++)
        if (thesis >> i & 1) {
            fprintf(out, "%s%d %s", between, i + 1, thesis_names[i]);
            between = ", ";
        }
    fprintf(out, "%s\n", thesis ? "" : "-");
}

/* Sums the seconds of each row. Sets `began` to true for each row that has a stage which began.
 * Returns the bits of the thesis' stages whose work these rows do. */
static unsigned sum_by_row(const progress_line *line, const stage_facts *f,
                           double seconds[STAGE_ROWS], bool began[STAGE_ROWS])
{
    unsigned all = 0;
    for (int i = 0; i < line->stage_count; i++) {
        stage_row row = stages_row(line->stages[i].name);
        seconds[row] += line->stages[i].seconds;
        began[row] = true;
        all |= thesis_bits(row, f);
    }
    return all;
}

void stages_print(FILE *out, const progress_line *line, const stage_facts *f, double seconds)
{
    double taken[STAGE_ROWS] = { 0 }, sum = 0;
    bool began[STAGE_ROWS] = { false };
    unsigned done = sum_by_row(line, f, taken, began);
    fprintf(out, "  %-10s%9s%10s  %s\n", "stage", "seconds", "faces/s",
            "stages of the thesis (EBP-Octree 2017, 3.6.4)");
    for (int r = 0; r < STAGE_ROWS; r++) {
        if (!began[r])
            continue;
        print_row(out, stage_names[r].name, taken[r], f->faces);
        print_thesis(out, thesis_bits((stage_row)r, f));
        sum += thesis_bits((stage_row)r, f) ? taken[r] : 0;
    }
    print_row(out, "all", seconds, f->faces);
    fprintf(out, "7 total (%.2f s of it in stages 1 to 6)\n", sum);
    if (!(done & THESIS_LEAF_PLANES))
        fprintf(out, "  not made: 3 leaf planes, 5 leaf clipping; readers derive them from the "
                     "faces of a leaf ('--profile full' stores them)\n");
}

/* --- JSON --- */

static void thesis_numbers(json *j, unsigned thesis)
{
    json_array(j, "thesis");
    for (int i = 0; i < THESIS_STAGES; i++)
        if (thesis >> i & 1)
            json_int(j, NULL, i + 1);
    json_end(j);
}

/* Writes a stage of the thesis, and the rows that do its work. `number`: 0 to 5, or THESIS_STAGES
 * for the sum of all stages. */
static void thesis_stage(json *j, int number, const stage_facts *f, const bool began[STAGE_ROWS],
                         const double taken[STAGE_ROWS])
{
    double sum = 0;
    unsigned stage_bits = number == THESIS_STAGES ? (1u << THESIS_STAGES) - 1 : 1u << number;
    json_object(j, NULL);
    json_int(j, "number", number + 1);
    json_text(j, "name", thesis_names[number]);
    json_array(j, "in");
    for (int r = 0; r < STAGE_ROWS; r++)
        if (began[r] && thesis_bits((stage_row)r, f) & stage_bits) {
            json_text(j, NULL, stage_names[r].name);
            sum += taken[r];
        }
    json_end(j);
    if (number == THESIS_STAGES)
        json_real(j, "seconds", sum);
    json_end(j);
}

void stages_json(json *j, const progress_line *line, const stage_facts *f)
{
    double taken[STAGE_ROWS] = { 0 };
    bool began[STAGE_ROWS] = { false };
    sum_by_row(line, f, taken, began);
    json_array(j, "stages");
    for (int i = 0; i < line->stage_count; i++) {
        stage_row row = stages_row(line->stages[i].name);
        json_object(j, NULL);
        json_text(j, "stage", line->stages[i].name);
        json_text(j, "name", stage_names[row].name);
        json_real(j, "seconds", line->stages[i].seconds);
        thesis_numbers(j, thesis_bits(row, f));
        json_end(j);
    }
    json_end(j);
    json_array(j, "thesis_stages");
    for (int i = 0; i <= THESIS_STAGES; i++)
        thesis_stage(j, i, f, began, taken);
    json_end(j);
}
