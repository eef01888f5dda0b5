/* The two halves of make_vectors. */
#ifndef MAKE_PARTS_H
#define MAKE_PARTS_H

/* Fill `folder`/passed; then, from these files, `folder`/failed. */
void make_passed(const char *folder);
void make_failed(const char *folder);

#endif
