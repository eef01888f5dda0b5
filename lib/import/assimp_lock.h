/* assimp's error text is one for the whole process: whoever calls it, to read or to write, holds
 * this. */
#ifndef EBPO_IMPORT_ASSIMP_LOCK_H
#define EBPO_IMPORT_ASSIMP_LOCK_H

void ebpo_assimp_lock(void);
void ebpo_assimp_unlock(void);

#endif
