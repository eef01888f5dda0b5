/* Declares the function poll of POSIX (os_windows_process.c), for descriptors of files, pipes and
 * sockets that are read. */
#ifndef EBPO_CORE_WINDOWS_POLL_H
#define EBPO_CORE_WINDOWS_POLL_H

struct pollfd {
    int fd;
    short events, revents;
};
#define POLLIN 1
int poll(struct pollfd *of, unsigned long count, int milliseconds);

#endif
