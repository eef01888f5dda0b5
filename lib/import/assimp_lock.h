/* assimp has one error text for the whole process: hold this lock during every call, to read or to
 * write. */
#ifndef EBPO_IMPORT_ASSIMP_LOCK_H
#define EBPO_IMPORT_ASSIMP_LOCK_H

void ebpo_assimp_lock(void);
void ebpo_assimp_unlock(void);

#endif
