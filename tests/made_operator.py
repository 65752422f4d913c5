"""A person at the cell who answers as a test has it."""

from dataclasses import dataclass, field


@dataclass
class Scripted:
    """Answers yes, or by the first key that the question contains; remembers everything said.

    `keys` are pressed once, when a line with those words was the last that was said.
    """

    answers: dict = field(default_factory=dict)
    said: list = field(default_factory=list)
    keys: dict = field(default_factory=dict)

    def tell(self, message):
        self.said.append(message)

    def confirm(self, question):
        return self._answer(question, True)

    def choose(self, question, options):
        return self._answer(question, options[0])

    def ask(self, question, default=None):
        return self._answer(question, default or "")

    def glance(self, line):
        self.said.append(line)

    def pressed(self):
        words = next((words for words in self.keys if self.said and words in self.said[-1]), None)
        return self.keys.pop(words, None)

    def _answer(self, question, default):
        self.said.append(question)
        key = next((key for key in self.answers if key in question), None)
        answer = default if key is None else self.answers[key]
        return answer.pop(0) if isinstance(answer, list) else answer

    def heard(self, words):
        return any(words in line for line in self.said)
