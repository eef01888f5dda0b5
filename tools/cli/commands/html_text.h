/* Names as text of a page. */
#ifndef EBPO_TOOLS_HTML_TEXT_H
#define EBPO_TOOLS_HTML_TEXT_H

#include <stdio.h>

/* Between tags. */
void html_put_text(FILE *f, const char *text);

#endif
