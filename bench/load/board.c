/* Simulated board: sends frames at given rates and answers queries.
 *
 * board FROM TO FRAMES ...
 *
 * FROM and TO are its own port and the reader's on loopback. FRAMES is FRAME@HZ, a periodic frame, or
 * QUERY=FRAME, the answer to a query; frames are hexadecimal. A line "HZ COUNT" on standard input
 * sends the first FRAME COUNT times at that rate; afterwards a line on standard output has the
 * nanoseconds that this took. After a line "bytes" it has the bytes received and sent so far, with
 * the headers of IPv4 and UDP. Ends with standard input.
 */
#include "../path/datagram.h"
#include <unistd.h>

enum { MOST = 32, HEADERS = 28 };
static const int64_t FOREVER = INT64_MAX;

typedef struct {
    Datagram frame;
    double period_ns;
    int64_t begin_ns, sent, count;
} Stream;

typedef struct {
    Datagram query, frame;
} Answer;

static int sock;
static Stream streams[MOST];
static Answer answers[MOST];
static int streaming, answering;
static long long received, sent;

static void start(Stream *s, double hz, int64_t count) {
    s->period_ns = hz > 0 ? S / hz : 0;
    s->begin_ns = now();
    s->sent = 0;
    s->count = hz > 0 ? count : 0;
}

static void add(const char *word) {
    size_t first = strcspn(word, "@=");
    if (streaming == MOST || answering == MOST || !word[first])
        fail("FROM TO FRAMES ...");
    Datagram left = parsed_of(word, first);
    const char *right = word + first + 1;
    if (word[first] == '@') {
        streams[streaming].frame = left;
        start(&streams[streaming++], atof(right), FOREVER);
    } else {
        answers[answering++] = (Answer){left, parsed(right)};
    }
}

static void transmit(const Datagram *d) {
    send(sock, d->bytes, d->size, 0);
    sent += HEADERS + d->size;
}

static int64_t due_ns(const Stream *s) {
    return s->sent < s->count ? s->begin_ns + (int64_t)(s->sent * s->period_ns) : FOREVER;
}

/* Send all due frames; return the time of the next one. */
static int64_t send_due(void) {
    int64_t next_ns = FOREVER;
    for (Stream *s = streams; s < streams + streaming; s++) {
        while (due_ns(s) <= now()) {
            transmit(&s->frame);
            if (++s->sent == s->count)
                printf("%lld\n", (long long)(now() - s->begin_ns));
        }
        next_ns = due_ns(s) < next_ns ? due_ns(s) : next_ns;
    }
    return next_ns;
}

static void answer(void) {
    unsigned char got[LONGEST];
    for (ssize_t size; (size = recv(sock, got, LONGEST, MSG_DONTWAIT)) > 0;) {
        received += HEADERS + size;
        for (Answer *a = answers; a < answers + answering; a++)
            if ((size_t)size == a->query.size && !memcmp(got, a->query.bytes, size))
                transmit(&a->frame);
    }
}

static void execute(void) {
    char line[100];
    ssize_t size = read(STDIN_FILENO, line, sizeof line - 1);
    double hz;
    long long count;
    if (size <= 0)
        exit(0);
    line[size] = 0;
    if (!strcmp(line, "bytes\n")) {
        printf("%lld %lld\n", received, sent);
        return;
    }
    if (sscanf(line, "%lf %lld", &hz, &count) != 2 || !streaming)
        fail("HZ COUNT");
    start(&streams[0], hz, count);
}

int main(int count, char **given) {
    if (count < 4)
        fail("FROM TO FRAMES ...");
    for (int i = 3; i < count; i++)
        add(given[i]);
    sock = bound(given[1], given[2]);
    setvbuf(stdout, NULL, _IOLBF, 0);
    ask_realtime();
    struct pollfd ends[] = {{sock, POLLIN, 0}, {STDIN_FILENO, POLLIN, 0}};
    for (;;) {
        int64_t next_ns = send_due(), left_ns = next_ns - now();
        left_ns = left_ns < 0 ? 0 : left_ns > S ? S : left_ns;
        struct timespec left = {left_ns / S, left_ns % S};
        ppoll(ends, 2, &left, NULL);
        if (ends[0].revents)
            answer();
        if (ends[1].revents)
            execute();
    }
}
