/* Stands for the POSIX header of this name: sys/socket.h declares its content. */
#include <sys/socket.h>
