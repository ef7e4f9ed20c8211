"""What the server that forks the commands of these tests has loaded before: see `warm`."""

import gc

import apprise

import gliderwatch.cli.doctor
import gliderwatch.cli.main
import gliderwatch.cli.status
import gliderwatch.export.maps
import gliderwatch.pages.render
import gliderwatch.service.daemon
import gliderwatch.service.replay
import gliderwatch.simulate.job  # noqa: F401

apprise.Apprise.instantiate("mailto://127.0.0.1")  # services are loaded with the first one
gc.collect()
gc.freeze()  # the collection at the end of a command then leaves all this alone
