/* Writes report.html from the template page/page.html: each {{name}} is replaced by the file of
 * that name, or by the data of the report. */
#include "ebpo_config.h"

#include <stdio.h>
#include <string.h>

#include "cli/json.h"
#include "cli/report/report_data.h"

#if EBPO_HAVE_CHART_JS

#include "cli/report/page_parts.h"

/* Returns the embedded file of this name, or the last element, whose name is NULL. */
static const page_part *find_part(const char *name, size_t length)
{
    const page_part *p = page_parts;
    while (p->name && (strlen(p->name) != length || memcmp(p->name, name, length) != 0))
        p++;
    return p;
}

/* Writes the pictures as data URIs: for each method, an object with the levels as keys. */
static void pictures_to_json(FILE *out, const comparison *c)
{
    json j;
    json_begin(&j, out);
    json_object(&j, NULL);
    if (c->portrait)
        json_text(&j, "portrait", c->portrait);
    json_array(&j, "levels");
    for (int i = 0; i < c->count; i++) {
        json_object(&j, NULL);
        for (int k = 0; k < EBPO_LEVELS_MAX; k++) {
            char level[16];
            snprintf(level, sizeof level, "%d", k);
            if (c->methods[i].picture[k])
                json_text(&j, level, c->methods[i].picture[k]);
        }
        json_end(&j);
    }
    json_finish(&j);
}

/* Writes the text that replaces {{name}}. */
static void put_part(FILE *out, const comparison *c, const char *name, size_t length)
{
    const page_part *part = find_part(name, length);
    if (part->name)
        fwrite(part->text, 1, part->size, out);
    else if (strncmp(name, "report.json", length) == 0)
        report_to_json(out, c, true);
    else if (strncmp(name, "pictures.json", length) == 0)
        pictures_to_json(out, c);
}

const char *report_page_missing(void) { return NULL; }

void report_page(FILE *out, const comparison *c)
{
    const char *at = find_part("page.html", strlen("page.html"))->text;
    for (const char *begin, *end; (begin = strstr(at, "{{")) && (end = strstr(begin, "}}"));
         at = end + 2) {
        fwrite(at, 1, (size_t)(begin - at), out);
        put_part(out, c, begin + 2, (size_t)(end - begin - 2));
    }
    fputs(at, out);
}

#else

const char *report_page_missing(void)
{
    return "this build has no Chart.js; install it (Debian: libjs-chart.js) and build ebpo again";
}

void report_page(FILE *out, const comparison *c)
{
    (void)out;
    (void)c;
}

#endif
