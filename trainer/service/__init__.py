"""What the trainer does by itself, for one site: collect its log, diagnose it, publish what is better, remember.

    exchange --> collecting.py --> archive (Parquet) --> recalibration.py --> exchange
                                                              |
                                              history.py, one line a run

Nothing that a site sends may stop the work on another: each module says in one sentence what it set aside.
`igrow.trainer.fleet` does the same for many sites.
"""
