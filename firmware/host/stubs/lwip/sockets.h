// Stand-in for lwIP's sockets: the host's own, with a cable that can be cut (sockets.cpp).
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <sys/types.h>

int lwip_socket(int family, int type, int protocol);
int lwip_connect(int socket, const sockaddr* address, socklen_t size);
int lwip_fcntl(int socket, int command, int value);
int lwip_select(int highest, fd_set* readable, fd_set* writable, fd_set* failed, timeval* timeout);
int lwip_setsockopt(int socket, int level, int option, const void* value, socklen_t size);
int lwip_getsockopt(int socket, int level, int option, void* value, socklen_t* size);
ssize_t lwip_recv(int socket, void* data, size_t size, int flags);
ssize_t lwip_send(int socket, const void* data, size_t size, int flags);
int lwip_close(int socket);
int lwip_inet_pton(int family, const char* text, void* address);
