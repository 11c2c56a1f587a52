/* The floor of this host: answers by comparing bytes. echo PORT HIT BREAK STOP */
#include <arpa/inet.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

static size_t parsed(const char *hex, unsigned char *bytes) {
    size_t size = strlen(hex) / 2;
    for (size_t i = 0; i < size; i++)
        sscanf(hex + 2 * i, "%2hhx", &bytes[i]);
    return size;
}

int main(int count, char **given) {
    unsigned char hit[1500], brake[1500], stop[1500], got[1500];
    if (count != 5)
        return 2;
    size_t hits = parsed(given[2], hit), brakes = parsed(given[3], brake),
           stops = parsed(given[4], stop);
    struct sockaddr_in here = {AF_INET, htons(atoi(given[1])), {htonl(INADDR_LOOPBACK)}, {0}}, peer;
    int sock = socket(AF_INET, SOCK_DGRAM, 0);
    if (bind(sock, (void *)&here, sizeof here))
        return 1;
    for (;;) {
        socklen_t length = sizeof peer;
        ssize_t size = recvfrom(sock, got, sizeof got, 0, (void *)&peer, &length);
        int is_hit = (size_t)size == hits && !memcmp(got, hit, hits);
        sendto(sock, is_hit ? brake : stop, is_hit ? brakes : stops, 0, (void *)&peer, length);
    }
}
