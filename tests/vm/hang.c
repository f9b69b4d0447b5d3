// Hangs one thread of another program, as a debugger does; its other threads go on: hang THREAD
// Ends when the thread has been killed.
#include <stdlib.h>
#include <sys/ptrace.h>
#include <sys/wait.h>

int main(int count, char **arguments) {
    pid_t thread = atoi(arguments[count - 1]);
    if (ptrace(PTRACE_SEIZE, thread, 0, 0) || ptrace(PTRACE_INTERRUPT, thread, 0, 0)) return 1;
    // The first event is the stop. A parent can wait for the killed program only after its tracer has.
    while (waitpid(thread, NULL, __WALL) > 0) {
    }
    return 0;
}
