/* Both halves of make_vectors. */
#ifndef MAKE_PARTS_H
#define MAKE_PARTS_H

/* Fill `folder`/passed; then, from what is there, `folder`/failed. */
void make_passed(const char *folder);
void make_failed(const char *folder);

#endif
