/* The vehicle at the ends of a path. It answers queries like a board, and times round trips.
 *
 * vehicle BOARD TO WITNESS SOURCE ROUNDS WARM STANDS ZERO ONE TWO [QUERY ANSWER ...]
 *
 * All ports are on loopback. BOARD is the board's own port, TO its peer's. At WITNESS it receives
 * stamps from the program at the other end of the path: a byte 0, 1 or 2, then eight bytes with
 * nanoseconds of the monotonic clock. From STANDS on all arguments are datagrams in hexadecimal.
 *
 * With a SOURCE a round begins with a byte to that port, which requests ONE or TWO alternately; it
 * lasts from the source's stamp to the arrival of that frame. Without (SOURCE 0) the vehicle sends
 * ONE or TWO, and the round lasts until the witness's stamp. STANDS is sent every 20 ms with a
 * source, and without ROUNDS, which means for ever.
 *
 * ZERO is repeated until it passes, at the beginning and after a lost round. Prints one line for
 * each round after the first WARM ones: its nanoseconds, -1 when it took over a second.
 */
#include "datagram.h"

enum { MOST = 8, KINDS = 3, FIXED = 11 };

static int board, witness, requests, repeats, pairs;
static Datagram stands, frames[KINDS], queries[MOST], answers[MOST];
static int64_t at_board[KINDS], at_witness[KINDS], repeat_ns; /* 0: not yet */

static void transmit(const Datagram *d) { send(board, d->bytes, d->size, 0); }

static int is(const Datagram *want, const Datagram *got) {
    return got->size == want->size && !memcmp(got->bytes, want->bytes, want->size);
}

static int came(int sock, Datagram *got) {
    ssize_t size = recv(sock, got->bytes, LONGEST, MSG_DONTWAIT);
    got->size = size > 0 ? size : 0;
    return size > 0;
}

static void on_frame(const Datagram *got) {
    for (int i = 0; i < pairs; i++)
        if (is(&queries[i], got))
            transmit(&answers[i]);
    for (int i = 0; i < KINDS && requests; i++)
        if (!at_board[i] && is(&frames[i], got))
            at_board[i] = now();
}

static void on_witness(const Datagram *got) {
    if (got->size == 9 && got->bytes[0] < KINDS)
        memcpy(&at_witness[got->bytes[0]], got->bytes + 1, 8);
}

/* Serve as a board until a time, or until one kind passed; return whether it did. */
static int served(int64_t until_ns, int kind) {
    Datagram got;
    for (;;) {
        while (came(board, &got))
            on_frame(&got);
        while (came(witness, &got))
            on_witness(&got);
        if (kind >= 0 && at_board[kind] && at_witness[kind])
            return 1;
        int64_t now_ns = now();
        if (now_ns >= until_ns)
            return 0;
        if (repeats && now_ns >= repeat_ns) {
            transmit(&stands);
            repeat_ns = now_ns + 20 * MS;
        }
        int64_t left_ns = (repeats && repeat_ns < until_ns ? repeat_ns : until_ns) - now_ns;
        struct timespec left = {left_ns / S, left_ns % S};
        struct pollfd both[] = {{.fd = board, .events = POLLIN}, {.fd = witness, .events = POLLIN}};
        ppoll(both, 2, &left, NULL);
    }
}

/* Send one kind, and wait for it; return whether it passed. */
static int passed(int kind, int64_t patience_ns) {
    unsigned char byte = kind;
    memset(at_board, 0, sizeof at_board);
    memset(at_witness, 0, sizeof at_witness);
    int64_t begin_ns = now();
    if (requests) {
        send(witness, &byte, 1, 0);
    } else {
        at_board[kind] = begin_ns;
        transmit(&frames[kind]);
    }
    return served(begin_ns + patience_ns, kind);
}

/* Wait until ZERO passes, then another kind, which may take longer. */
static void join(int kind) {
    int64_t lost_ns = now() + 30 * S;
    do {
        while (!passed(0, 20 * MS))
            if (now() > lost_ns)
                fail("nothing passes");
    } while (!passed(kind, S));
}

int main(int count, char **given) {
    pairs = (count - FIXED) / 2;
    if (count < FIXED || pairs > MOST)
        fail("BOARD TO WITNESS SOURCE ROUNDS WARM STANDS ZERO ONE TWO [QUERY ANSWER ...]");
    int rounds = atoi(given[5]), warm = atoi(given[6]);
    requests = atoi(given[4]);
    repeats = requests || !rounds;
    stands = parsed(given[7]);
    for (int i = 0; i < KINDS; i++)
        frames[i] = parsed(given[8 + i]);
    for (int i = 0; i < pairs; i++) {
        queries[i] = parsed(given[FIXED + 2 * i]);
        answers[i] = parsed(given[FIXED + 1 + 2 * i]);
    }
    board = bound(given[1], given[2]);
    witness = bound(given[3], given[4]);

    ask_realtime();

    srand(1);
    while (!rounds)
        served(now() + S, -1);
    int kind = 1;
    join(kind);
    for (int round = -warm; round < rounds; round++) {
        kind = 3 - kind; /* ONE and TWO alternate */
        served(now() + 2 * MS + rand() % (6 * MS), -1); /* not synchronous with any timer */
        int through = passed(kind, S);
        int64_t took_ns = at_board[kind] - at_witness[kind];
        if (round >= 0)
            printf("%lld\n", (long long)(!through ? -1 : requests ? took_ns : -took_ns));
        if (!through)
            join(kind);
    }
    return 0;
}
