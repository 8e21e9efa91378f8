/* A UDP echo, the physical limit of the reply benchmark: what the kernel alone costs, without a look at the datagram.
 *
 * It has what the control loop has where permitted: SCHED_FIFO 50 and locked memory. With one port it blocks in recvfrom,
 * with more it polls them, as a server of several arms must.
 */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <unistd.h>

enum { MAX_PORTS = 8, PRIORITY = 50 };

static struct pollfd ports[MAX_PORTS];

static int listen_on(int port)
{
    struct sockaddr_in here = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK), .sin_port = htons((uint16_t)port)};
    int server = socket(AF_INET, SOCK_DGRAM, 0);
    if (bind(server, (struct sockaddr *)&here, sizeof here)) { perror("echo"); exit(1); }
    return server;
}

static void answer(int server)
{
    char bytes[2048];
    struct sockaddr_in peer;
    socklen_t length = sizeof peer;
    ssize_t size = recvfrom(server, bytes, sizeof bytes, 0, (struct sockaddr *)&peer, &length);
    if (size >= 0 && sendto(server, bytes, (size_t)size, 0, (struct sockaddr *)&peer, length) < 0) perror("echo");
}

int main(int count, char **words)
{
    struct sched_param parameter = {.sched_priority = PRIORITY};
    int used = count - 1 < MAX_PORTS ? count - 1 : MAX_PORTS;
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    for (int i = 0; i < used; ++i) ports[i] = (struct pollfd){listen_on(atoi(words[i + 1])), POLLIN, 0};
    int is_prompt = !sched_setscheduler(0, SCHED_FIFO, &parameter) & !mlockall(MCL_CURRENT | MCL_FUTURE);
    fprintf(stderr, "echo: real-time priority and locked memory %s\n", is_prompt ? "granted" : "not permitted");
    printf("ready %d\n", getpid()), fflush(stdout);
    if (used == 1) for (;;) answer(ports[0].fd);
    while (used && poll(ports, (nfds_t)used, -1) > 0)
        for (int i = 0; i < used; ++i) if (ports[i].revents) answer(ports[i].fd);
    return 1;
}
