
/* The numbers of the controller: ports, states, and numbers in between, by the names that the spec has for blocks and ports. */
enum {
$places
};

typedef ws_${stem}_state ws_state;

$programs
void ws_${stem}_init(ws_state *s)
{
    static const ws_state rest = {0};
    *s = rest;
}

void ws_${stem}_step(ws_state *s, $arguments)
{
    static const unsigned short PROGRAM[] = {
    $turns
    };
$given
    switch (PROGRAM[s->turn]) {
$cases
    }
$taken
    s->turn = s->turn + 1 == $count ? 0 : s->turn + 1;
}
