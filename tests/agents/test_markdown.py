from agents.command import table


def test_a_table():
    assert table(["a", "b"], [["1", "2"], ["3"]]) == "| a | b |\n| --- | --- |\n| 1 | 2 |\n| 3 |  |"
