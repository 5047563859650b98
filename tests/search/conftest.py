from toy_runs import forgotten, toy

__all__ = ["forgotten", "toy"]
