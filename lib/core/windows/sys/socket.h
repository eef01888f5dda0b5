/* Declares the sockets of POSIX (os_windows_sockets.c). Structures and constants have the layouts
 * and values of winsock2.h; os_windows_sockets.c includes winsock2.h before this header. The macros
 * rename functions of Windows with the same names: a descriptor is not a SOCKET. */
#ifndef EBPO_CORE_WINDOWS_SOCKET_H
#define EBPO_CORE_WINDOWS_SOCKET_H

#include <sys/time.h>
#include <sys/types.h>

#ifndef _WINSOCK2API_

typedef int socklen_t;
struct sockaddr {
    unsigned short sa_family;
    char sa_data[14];
};
struct in_addr {
    uint32_t s_addr;
};
struct sockaddr_in {
    unsigned short sin_family, sin_port;
    struct in_addr sin_addr;
    char sin_zero[8];
};
struct sockaddr_un {
    unsigned short sun_family;
    char sun_path[108];
};

#define AF_UNIX         1
#define AF_INET         2
#define SOCK_STREAM     1
#define SOCK_DGRAM      2
#define SOL_SOCKET      0xffff
#define SO_REUSEADDR    4
#define SO_SNDTIMEO     0x1005
#define IPPROTO_TCP     6
#define TCP_NODELAY     1
#define INADDR_LOOPBACK 0x7f000001
#define INET_ADDRSTRLEN 16
#define SHUT_WR         1
#define SHUT_RDWR       2

static inline unsigned short htons(unsigned short x) { return (unsigned short)(x << 8 | x >> 8); }
static inline unsigned short ntohs(unsigned short x) { return htons(x); }
static inline uint32_t htonl(uint32_t x) { return __builtin_bswap32(x); }

#define socket      ebpo_windows_socket
#define bind        ebpo_windows_bind
#define listen      ebpo_windows_listen
#define accept      ebpo_windows_accept
#define connect     ebpo_windows_connect
#define shutdown    ebpo_windows_shutdown
#define getsockname ebpo_windows_getsockname
#define setsockopt  ebpo_windows_setsockopt
#define send        ebpo_windows_send
#define sendto      ebpo_windows_sendto
#define recv        ebpo_windows_recv
#define recvfrom    ebpo_windows_recvfrom
#define inet_pton   ebpo_windows_inet_pton
#define inet_ntop   ebpo_windows_inet_ntop

#endif

#define MSG_DONTWAIT 0x10000
#define MSG_TRUNC    0x20000 /* recvfrom returns a size above that of the buffer */

int ebpo_windows_socket(int domain, int type, int protocol);
int ebpo_windows_bind(int fd, const struct sockaddr *at, socklen_t bytes);
int ebpo_windows_listen(int fd, int most);
int ebpo_windows_accept(int fd, struct sockaddr *from, socklen_t *bytes);
int ebpo_windows_connect(int fd, const struct sockaddr *to, socklen_t bytes);
int ebpo_windows_shutdown(int fd, int how);
int ebpo_windows_getsockname(int fd, struct sockaddr *out, socklen_t *bytes);
/* SO_REUSEADDR makes the address exclusive: with the option of this name, Windows lets other
 * programs take the address over. */
int ebpo_windows_setsockopt(int fd, int level, int name, const void *value, socklen_t bytes);
ssize_t ebpo_windows_send(int fd, const void *data, size_t bytes, int flags);
ssize_t ebpo_windows_sendto(int fd, const void *data, size_t bytes, int flags,
                            const struct sockaddr *to, socklen_t size);
ssize_t ebpo_windows_recv(int fd, void *data, size_t bytes, int flags);
ssize_t ebpo_windows_recvfrom(int fd, void *data, size_t bytes, int flags, struct sockaddr *from,
                              socklen_t *size);
int ebpo_windows_inet_pton(int family, const char *text, void *out);
const char *ebpo_windows_inet_ntop(int family, const void *address, char *out, socklen_t bytes);

#endif
