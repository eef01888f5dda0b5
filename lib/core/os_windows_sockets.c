/* Implements the sockets of POSIX (windows/sys/socket.h) with those of Windows. A descriptor of the
 * C library contains the socket, so that `close` closes it and `poll` waits for it. */
#define WIN32_LEAN_AND_MEAN
#include <winsock2.h>
#include <ws2tcpip.h>

#include <sys/socket.h>

#include "core/os_windows_parts.h"

/* Sets errno to the value for the last error of a socket. Returns -1. */
static int fail_socket(void)
{
    static const struct {
        int fault, number;
    } numbers[] = {
        { WSAEACCES, EACCES },
        { WSAEADDRINUSE, EADDRINUSE },
        { WSAEADDRNOTAVAIL, EADDRNOTAVAIL },
        { WSAEAFNOSUPPORT, EAFNOSUPPORT },
        { WSAEBADF, EBADF },
        { WSAECONNABORTED, ECONNABORTED },
        { WSAECONNREFUSED, ECONNREFUSED },
        { WSAECONNRESET, ECONNRESET },
        { WSAEINTR, EINTR },
        { WSAEINVAL, EINVAL },
        { WSAEMFILE, EMFILE },
        { WSAENETDOWN, ENETDOWN },
        { WSAENETUNREACH, ENETUNREACH },
        { WSAENOBUFS, ENOBUFS },
        { WSAENOTCONN, ENOTCONN },
        { WSAENOTSOCK, ENOTSOCK },
        { WSAESHUTDOWN, EPIPE },
        { WSAETIMEDOUT, ETIMEDOUT },
        { WSAEWOULDBLOCK, EAGAIN },
    };
    int fault = WSAGetLastError();
    errno = EIO;
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++)
        if (numbers[i].fault == fault)
            errno = numbers[i].number;
    return -1;
}

static int result_of(int result) { return result == SOCKET_ERROR ? fail_socket() : result; }

/* --- descriptors --- */

static SOCKET socket_of(int fd) { return (SOCKET)_get_osfhandle(fd); }

/* Makes a descriptor of a new socket. Closes the socket on failure. */
static int descriptor_of(SOCKET new_socket)
{
    if (new_socket == INVALID_SOCKET)
        return fail_socket();
    SetHandleInformation((HANDLE)new_socket, HANDLE_FLAG_INHERIT, 0);
    int fd = _open_osfhandle((intptr_t)new_socket, O_RDWR | O_BINARY);
    if (fd < 0)
        closesocket(new_socket);
    return fd;
}

static void start_sockets(void)
{
    WSADATA facts;
    (void)WSAStartup(MAKEWORD(2, 2), &facts); /* on failure, `socket` reports it */
}

int ebpo_windows_socket(int domain, int type, int protocol)
{
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    pthread_once(&once, start_sockets);
    return descriptor_of(socket(domain, type, protocol));
}

/* Returns true if a read from the socket would not wait. */
static bool is_readable(SOCKET s)
{
    fd_set set;
    struct timeval none = { 0, 0 };
    FD_ZERO(&set);
    FD_SET(s, &set);
    return select(0, &set, NULL, NULL, &none) != 0; /* after an error, recv reports it */
}

int ebpo_windows_socket_state(int fd)
{
    int type, size = sizeof type;
    SOCKET s = socket_of(fd);
    if (getsockopt(s, SOL_SOCKET, SO_TYPE, (char *)&type, &size) != 0)
        return -1;
    return is_readable(s);
}

int ebpo_windows_socket_waits(int fd, bool waits)
{
    u_long nonblocking = !waits;
    return result_of(ioctlsocket(socket_of(fd), (long)FIONBIO, &nonblocking));
}

/* --- addresses and connections --- */

int ebpo_windows_bind(int fd, const struct sockaddr *at, socklen_t bytes)
{
    return result_of(bind(socket_of(fd), at, bytes));
}

int ebpo_windows_listen(int fd, int most) { return result_of(listen(socket_of(fd), most)); }

int ebpo_windows_accept(int fd, struct sockaddr *from, socklen_t *bytes)
{
    return descriptor_of(accept(socket_of(fd), from, bytes));
}

int ebpo_windows_connect(int fd, const struct sockaddr *to, socklen_t bytes)
{
    return result_of(connect(socket_of(fd), to, bytes));
}

int ebpo_windows_shutdown(int fd, int how) { return result_of(shutdown(socket_of(fd), how)); }

int ebpo_windows_getsockname(int fd, struct sockaddr *out, socklen_t *bytes)
{
    return result_of(getsockname(socket_of(fd), out, bytes));
}

int ebpo_windows_setsockopt(int fd, int level, int name, const void *value, socklen_t bytes)
{
    SOCKET s = socket_of(fd);
    if (level == SOL_SOCKET && name == SO_SNDTIMEO) {
        const struct timeval *limit = value;
        DWORD milliseconds = (DWORD)(1000 * limit->tv_sec + limit->tv_usec / 1000);
        return result_of(
            setsockopt(s, level, name, (const char *)&milliseconds, (int)sizeof milliseconds));
    }
    if (level == SOL_SOCKET && name == SO_REUSEADDR)
        name = SO_EXCLUSIVEADDRUSE;
    return result_of(setsockopt(s, level, name, value, bytes));
}

int ebpo_windows_inet_pton(int family, const char *text, void *out)
{
    return inet_pton(family, text, out);
}

const char *ebpo_windows_inet_ntop(int family, const void *address, char *out, socklen_t bytes)
{
    return inet_ntop(family, address, out, (size_t)bytes);
}

/* --- data --- */

/* Returns the number of bytes for one call. */
static int int_size_of(size_t bytes) { return bytes < INT_MAX ? (int)bytes : INT_MAX; }

ssize_t ebpo_windows_send(int fd, const void *data, size_t bytes, int flags)
{
    return result_of(send(socket_of(fd), data, int_size_of(bytes), flags & ~MSG_DONTWAIT));
}

ssize_t ebpo_windows_sendto(int fd, const void *data, size_t bytes, int flags,
                            const struct sockaddr *to, socklen_t size)
{
    return result_of(
        sendto(socket_of(fd), data, int_size_of(bytes), flags & ~MSG_DONTWAIT, to, size));
}

ssize_t ebpo_windows_recv(int fd, void *data, size_t bytes, int flags)
{
    return ebpo_windows_recvfrom(fd, data, bytes, flags, NULL, NULL);
}

ssize_t ebpo_windows_recvfrom(int fd, void *data, size_t bytes, int flags, struct sockaddr *from,
                              socklen_t *size)
{
    SOCKET s = socket_of(fd);
    if (flags & MSG_DONTWAIT && !is_readable(s)) {
        errno = EAGAIN;
        return -1;
    }
    int limit = int_size_of(bytes), given = flags & ~(MSG_DONTWAIT | MSG_TRUNC),
        received = recvfrom(s, data, limit, given, from, size);
    if (received == SOCKET_ERROR && WSAGetLastError() == WSAEMSGSIZE)
        return flags & MSG_TRUNC ? (ssize_t)limit + 1 : limit;
    return result_of(received);
}
