"""The paper re-examined: its method, its print and its claims (`hoof-env reproduce --study`)."""
