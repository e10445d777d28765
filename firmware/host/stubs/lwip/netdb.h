// Stand-in for lwIP's names.
#pragma once

#include <netdb.h>

int lwip_getaddrinfo(const char* name, const char* service, const addrinfo* hints, addrinfo** found);
void lwip_freeaddrinfo(addrinfo* found);
