"""The numbers that the trainer draws, so that both sides hold out the same demonstrations and score the same
far pairs: ChaCha with 8 rounds, seeded and used as the crates `rand_chacha` 0.9 and `rand` 0.9 do."""

from collections.abc import Iterator

_MASK32 = 0xFFFFFFFF
_MASK64 = 0xFFFFFFFFFFFFFFFF
_CONSTANTS = (0x61707865, 0x3320646E, 0x79622D32, 0x6B206574)
# Columns, then diagonals of the 4x4 state.
_QUARTERS = (
    (0, 4, 8, 12),
    (1, 5, 9, 13),
    (2, 6, 10, 14),
    (3, 7, 11, 15),
    (0, 5, 10, 15),
    (1, 6, 11, 12),
    (2, 7, 8, 13),
    (3, 4, 9, 14),
)


def chacha8_words(key: list[int]) -> Iterator[int]:
    """The key stream of eight 32-bit words as 32-bit words, with stream number 0."""
    counter = 0
    while True:
        start = [*_CONSTANTS, *key, counter & _MASK32, counter >> 32, 0, 0]
        state = list(start)
        for _ in range(4):
            for a, b, c, d in _QUARTERS:
                for into, other, turned, left in ((a, b, d, 16), (c, d, b, 12), (a, b, d, 8), (c, d, b, 7)):
                    state[into] = (state[into] + state[other]) & _MASK32
                    mixed = state[turned] ^ state[into]
                    state[turned] = (mixed << left | mixed >> (32 - left)) & _MASK32
        yield from ((now + then) & _MASK32 for now, then in zip(state, start))
        counter += 1


def _key_of_seed(seed: int) -> list[int]:
    """A key from a 64-bit seed: eight outputs of PCG32."""
    key, state = [], seed
    for _ in range(8):
        state = (state * 6364136223846793005 + 11634580027462260723) & _MASK64
        mixed = ((state >> 18 ^ state) >> 27) & _MASK32
        turn = state >> 59
        key.append((mixed >> turn | mixed << (32 - turn)) & _MASK32)
    return key


class RustRandom:
    """`ChaCha8Rng::seed_from_u64(seed)` with the two ways in which it is used here."""

    def __init__(self, seed: int) -> None:
        self._words = chacha8_words(_key_of_seed(seed))

    def below(self, bound: int) -> int:
        """`random_range(0..bound)` for a bound of 32 bits."""
        product = next(self._words) * bound
        result, low = product >> 32, product & _MASK32
        if low > (-bound & _MASK32):
            # Close to the edge a second word decides.
            result += low + (next(self._words) * bound >> 32) > _MASK32
        return result

    def shuffle(self, items: list[int]) -> None:
        """`items.shuffle(rng)`: one draw serves as many places as fit into 32 bits."""
        chunk, left = 0, 1
        for place in range(len(items)):
            size = place + 1
            if left == 0:
                bound = size
                left = 1
                while bound * (size + left) <= _MASK32:
                    bound *= size + left
                    left += 1
                chunk = self.below(bound)
            left -= 1
            index = chunk if left == 0 else chunk % size
            chunk //= size
            items[place], items[index] = items[index], items[place]
