/* Shared by the programs that simulate the board: time, datagrams, a socket on loopback. */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <errno.h>
#include <poll.h>
#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>

enum { MS = 1000000, LONGEST = 1500 };
static const int64_t S = 1000 * MS;

typedef struct {
    unsigned char bytes[LONGEST];
    size_t size;
} Datagram;

static inline int64_t now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * S + t.tv_nsec;
}

static inline void fail(const char *what) {
    fprintf(stderr, "%s: %s\n", program_invocation_short_name, what);
    exit(1);
}

/* Parse hexadecimal digits. */
static inline Datagram parsed_of(const char *hex, size_t digits) {
    Datagram d = {.size = digits / 2};
    if (d.size > LONGEST)
        fail("too long");
    for (size_t i = 0; i < d.size; i++)
        if (sscanf(hex + 2 * i, "%2hhx", &d.bytes[i]) != 1)
            fail("not hexadecimal");
    return d;
}

static inline Datagram parsed(const char *hex) { return parsed_of(hex, strlen(hex)); }

/* A socket bound to one port and connected to another; not connected for port 0. */
static inline int bound(const char *from, const char *to) {
    struct sockaddr_in here = {AF_INET, htons(atoi(from)), {htonl(INADDR_LOOPBACK)}, {0}};
    struct sockaddr_in there = here;
    there.sin_port = htons(atoi(to));
    int sock = socket(AF_INET, SOCK_DGRAM, 0);
    if (bind(sock, (void *)&here, sizeof here))
        fail("cannot bind its port");
    if (there.sin_port && connect(sock, (void *)&there, sizeof there))
        fail("cannot connect to a port");
    return sock;
}

/* Ask for SCHED_FIFO: a real board is another computer, and load on this host must not delay it. */
static inline void ask_realtime(void) {
    sched_setscheduler(0, SCHED_FIFO, &(struct sched_param){.sched_priority = 80});
}
