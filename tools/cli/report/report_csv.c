/* Writes report.csv: a line for each value. */
#include <stdio.h>

#include "cli/report/report_data.h"

/* Prints a line. Names have no commas. If `v` is NAN (not available), the field of the value is
 * empty. If `level` is -1, the value does not belong to a level. */
static void print_metric(FILE *out, const char *name, int level, const char *parameter,
                         const metric_name *q, double v)
{
    fprintf(out, "%s,", name);
    if (level >= 0)
        fprintf(out, "%d", level);
    fprintf(out, ",%s,%s,", parameter, q->name);
    if (!isnan(v))
        fprintf(out, "%.17g", v);
    fprintf(out, ",%s\n", q->unit);
}

static void print_method(FILE *out, const comparison *c, const method *m)
{
    char parameter[64];
    for (int k = 0; k < WHOLE_METRICS; k++)
        print_metric(out, m->name, -1, "", &whole_metrics[k], m->whole[k]);
    for (int i = c->first; i <= method_last(c, m); i++)
        for (int k = 0; k < LEVEL_METRICS; k++)
            print_metric(out, m->name, i, "", &level_metrics[k], m->level[i][k]);
    for (int i = 0; i < DEADLINES; i++) {
        snprintf(parameter, sizeof parameter, "%uus", deadlines_us[i]);
        for (int k = 0; k < DEADLINE_METRICS; k++)
            print_metric(out, m->name, -1, parameter, &deadline_metrics[k], m->deadline[i][k]);
    }
    for (int i = 0; i < BUDGETS; i++) {
        snprintf(parameter, sizeof parameter, "memory/%u", budget_parts[i]);
        for (int k = 0; k < BUDGET_METRICS; k++)
            print_metric(out, m->name, -1, parameter, &budget_metrics[k], m->budget[i][k]);
    }
    for (int i = 0; i < m->target_count; i++) {
        snprintf(parameter, sizeof parameter, "%s=%.17g",
                 m->targets[i].kind == TARGET_ERROR ? "max_error" : "target_bytes",
                 m->targets[i].requested);
        for (int k = 0; k < TARGET_METRICS; k++)
            print_metric(out, m->name, -1, parameter, &target_metrics[k], m->targets[i].metric[k]);
    }
}

void report_csv(FILE *out, const comparison *c)
{
    fputs("method,level,parameter,quantity,value,unit\n", out);
    for (int i = 0; i < c->count; i++)
        print_method(out, c, &c->methods[i]);
}
