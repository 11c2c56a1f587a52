/* Simulated board: reports a bumper hit and waits for the BREAK that answers it.
 *
 * board FROM TO ROUNDS WARM HIT CLEAR BREAK STOP [REPEAT ...]
 *
 * FROM and TO are its own port and the peer's on loopback. Then follow datagrams in hexadecimal: the
 * hit, the all-clear, the two answers, and datagrams that are repeated every 20 ms. Before each hit
 * the peer must have sent STOP and no BREAK since, so that an old BREAK does not count as an answer;
 * until then the all-clear is sent each millisecond. Prints one line for each round after the first
 * WARM ones, in which the peer may still start: nanoseconds from sending the hit to the BREAK.
 */
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

enum { MS = 1000000, LONGEST = 1500, MOST = 8 };
static const int64_t S = 1000 * MS;

typedef struct {
    unsigned char bytes[LONGEST];
    size_t size;
} Datagram;

static int64_t now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * S + t.tv_nsec;
}

static void fail(const char *what) {
    fprintf(stderr, "%s: %s\n", program_invocation_short_name, what);
    exit(1);
}

/* Parse hexadecimal digits. */
static Datagram parsed(const char *hex) {
    Datagram d = {.size = strlen(hex) / 2};
    if (d.size > LONGEST)
        fail("too long");
    for (size_t i = 0; i < d.size; i++)
        if (sscanf(hex + 2 * i, "%2hhx", &d.bytes[i]) != 1)
            fail("not hexadecimal");
    return d;
}

/* A socket bound to one port and connected to another, on loopback. */
static int bound(const char *from, const char *to) {
    struct sockaddr_in here = {AF_INET, htons(atoi(from)), {htonl(INADDR_LOOPBACK)}, {0}};
    struct sockaddr_in there = here;
    there.sin_port = htons(atoi(to));
    int sock = socket(AF_INET, SOCK_DGRAM, 0);
    if (bind(sock, (void *)&here, sizeof here))
        fail("cannot bind its port");
    if (connect(sock, (void *)&there, sizeof there))
        fail("cannot connect to a port");
    return sock;
}

/* Ask for SCHED_FIFO: a real board is another computer, and load on this host must not delay it. */
static void ask_realtime(void) {
    sched_setscheduler(0, SCHED_FIFO, &(struct sched_param){.sched_priority = 80});
}

static int sock;

static void transmit(const Datagram *d) { send(sock, d->bytes, d->size, 0); }

static int is(const Datagram *want, const unsigned char *got, ssize_t size) {
    return (size_t)size == want->size && !memcmp(got, want->bytes, want->size);
}

/* Wait for a datagram until a time; 0 when none arrives. */
static ssize_t receive(unsigned char *got, int64_t until_ns) {
    for (;;) {
        ssize_t size = recv(sock, got, LONGEST, MSG_DONTWAIT);
        int64_t left_ns = until_ns - now();
        if (size > 0)
            return size;
        if (left_ns <= 0)
            return 0;
        struct timespec left = {left_ns / S, left_ns % S};
        ppoll(&(struct pollfd){.fd = sock, .events = POLLIN}, 1, &left, NULL);
    }
}

int main(int count, char **given) {
    if (count < 9 || count > 9 + MOST)
        fail("FROM TO ROUNDS WARM HIT CLEAR BREAK STOP [REPEAT ...]");
    int rounds = atoi(given[3]), warm = atoi(given[4]), repeats = count - 9;
    Datagram hit = parsed(given[5]), clear = parsed(given[6]), brake = parsed(given[7]),
             stop = parsed(given[8]), repeat[MOST];
    for (int i = 0; i < repeats; i++)
        repeat[i] = parsed(given[9 + i]);
    sock = bound(given[1], given[2]);

    ask_realtime();

    unsigned char got[LONGEST];
    srand(1);
    for (int round = -warm; round < rounds; round++) {
        int64_t lost_ns = now() + 30 * S, clear_ns = 0, repeat_ns = 0;
        for (int stopped = 0, clears = 0; !stopped || clears < 4;) {
            if (now() > lost_ns)
                fail("no STOP received");
            if (now() >= repeat_ns) {
                for (int i = 0; i < repeats; i++)
                    transmit(&repeat[i]);
                repeat_ns = now() + 20 * MS;
            }
            if (now() >= clear_ns) {
                transmit(&clear);
                clears++;
                clear_ns = now() + (clears < 4 ? MS / 2 : MS);
            }
            ssize_t size = receive(got, clear_ns);
            if (is(&brake, got, size))
                stopped = 0;
            else if (is(&stop, got, size))
                stopped = 1;
        }
        /* At a random time. */
        int64_t due_ns = now() + MS / 2 + rand() % (2 * MS);
        int again = 0;
        for (ssize_t size; (size = receive(got, due_ns));)
            again |= is(&brake, got, size);
        if (again) {
            round--;
            continue;
        }
        int64_t hit_ns = now();
        transmit(&hit);
        ssize_t size;
        while ((size = receive(got, hit_ns + S)) && !is(&brake, got, size))
            ;
        if (!size && round >= 0)
            fail("no BREAK within a second");
        int64_t took_ns = now() - hit_ns;
        if (round >= 0)
            printf("%lld\n", (long long)took_ns);
    }
    return 0;
}
