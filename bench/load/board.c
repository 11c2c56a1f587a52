/* A board that says what it is told to, as often as it is told to, and answers questions.
 *
 * board FROM TO SAY ...
 *
 * FROM and TO are ports on loopback: its own, and of whoever reads. SAY is FRAME@HZ, what is sent
 * unasked, or QUERY=FRAME, what answers which datagram; frames are hexadecimal. A line "HZ COUNT"
 * on standard input sends the first FRAME so often, so many times; when that is done, a line on
 * standard output has the nanoseconds that it took. It ends with standard input.
 */
#include "../path/datagram.h"
#include <unistd.h>

enum { MOST = 32 };
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

static void start(Stream *s, double hz, int64_t count) {
    s->period_ns = hz > 0 ? S / hz : 0;
    s->begin_ns = now();
    s->sent = 0;
    s->count = hz > 0 ? count : 0;
}

static void add(const char *word) {
    size_t first = strcspn(word, "@=");
    if (streaming == MOST || answering == MOST || !word[first])
        fail("FROM TO SAY ...");
    Datagram left = parsed_of(word, first);
    const char *right = word + first + 1;
    if (word[first] == '@') {
        streams[streaming].frame = left;
        start(&streams[streaming++], atof(right), FOREVER);
    } else {
        answers[answering++] = (Answer){left, parsed(right)};
    }
}

static void say(const Datagram *d) { send(sock, d->bytes, d->size, 0); }

static int64_t due_ns(const Stream *s) {
    return s->sent < s->count ? s->begin_ns + (int64_t)(s->sent * s->period_ns) : FOREVER;
}

/* Send what is due; return when the next one is. */
static int64_t speak(void) {
    int64_t next_ns = FOREVER;
    for (Stream *s = streams; s < streams + streaming; s++) {
        while (due_ns(s) <= now()) {
            say(&s->frame);
            if (++s->sent == s->count)
                printf("%lld\n", (long long)(now() - s->begin_ns));
        }
        next_ns = due_ns(s) < next_ns ? due_ns(s) : next_ns;
    }
    return next_ns;
}

static void hear(void) {
    unsigned char got[LONGEST];
    for (ssize_t size; (size = recv(sock, got, LONGEST, MSG_DONTWAIT)) > 0;)
        for (Answer *a = answers; a < answers + answering; a++)
            if ((size_t)size == a->query.size && !memcmp(got, a->query.bytes, size))
                say(&a->frame);
}

static void obey(void) {
    char line[100];
    ssize_t size = read(STDIN_FILENO, line, sizeof line - 1);
    double hz;
    long long count;
    if (size <= 0)
        exit(0);
    line[size] = 0;
    if (sscanf(line, "%lf %lld", &hz, &count) != 2 || !streaming)
        fail("HZ COUNT");
    start(&streams[0], hz, count);
}

int main(int count, char **given) {
    if (count < 4)
        fail("FROM TO SAY ...");
    for (int i = 3; i < count; i++)
        add(given[i]);
    sock = bound(given[1], given[2]);
    setvbuf(stdout, NULL, _IOLBF, 0);
    go_ahead();
    struct pollfd ends[] = {{sock, POLLIN, 0}, {STDIN_FILENO, POLLIN, 0}};
    for (;;) {
        int64_t next_ns = speak(), left_ns = next_ns - now();
        left_ns = left_ns < 0 ? 0 : left_ns > S ? S : left_ns;
        struct timespec left = {left_ns / S, left_ns % S};
        ppoll(ends, 2, &left, NULL);
        if (ends[0].revents)
            hear();
        if (ends[1].revents)
            obey();
    }
}
