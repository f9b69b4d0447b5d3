//! Tests a campaign that sends replays to a session of other processes and loses that session.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by them")]

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use datafusion::catalog::Session;
use datafusion::common::{Result, plan_err};
use datafusion::execution::SessionStateBuilder;
use datafusion::execution::context::QueryPlanner;
use datafusion::logical_expr::LogicalPlan;
use datafusion::physical_plan::ExecutionPlan;
use datafusion::physical_planner::{DefaultPhysicalPlanner, PhysicalPlanner as _};
use datafusion::prelude::SessionContext;
use headrace_campaign::cache::Cache;
use headrace_campaign::campaign::Campaign;
use headrace_campaign::maker::Maker;
use headrace_campaign::place::Place;
use headrace_tables::Parameters;

/// A session that fails at each of its first two plans, after `at_each` dives have been replayed.
#[derive(Debug)]
struct Lost {
    maker: Arc<Maker>,
    place: Place,
    at_each: usize,
    plans: AtomicUsize,
}

#[async_trait::async_trait]
impl QueryPlanner for Lost {
    async fn create_physical_plan(
        &self,
        plan: &LogicalPlan,
        session: &dyn Session,
    ) -> Result<Arc<dyn ExecutionPlan>> {
        let before = self.plans.fetch_add(1, Ordering::Relaxed);
        if before == 2 {
            return DefaultPhysicalPlanner::default().create_physical_plan(plan, session).await;
        }
        for dive in self.place.dives().await.unwrap().iter().skip(before * self.at_each).take(self.at_each) {
            self.maker.make(&self.place, dive, &Parameters::default()).await.unwrap();
        }
        plan_err!("lost")
    }
}

/// Runs a campaign of five dives with a session that fails twice.
///
/// `at_each` dives are finished before each failure. Returns the number of plans sent, and the result.
async fn sent(at_each: usize) -> (usize, std::result::Result<usize, String>) {
    let (folder, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    for log in ["adrift", "murk", "sectors", "stalls", "steel"] {
        let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../tests/golden/{log}.mcap"));
        std::fs::copy(golden, folder.path().join(format!("{log}.mcap"))).unwrap();
    }
    let maker = |threads| Arc::new(Maker::new(Cache::open(scratch.path()).unwrap(), threads));
    let place = Place::open(folder.path().to_str().unwrap()).unwrap();
    let mut campaign = Campaign::open(place.clone(), Parameters::default(), maker(1), 1).await.unwrap();
    let lost = Arc::new(Lost { maker: maker(1), place, at_each, plans: AtomicUsize::new(0) });
    let state = SessionStateBuilder::new().with_default_features().with_query_planner(lost.clone()).build();
    campaign.send_to(SessionContext::new_with_state(state)).unwrap();
    let made = campaign.make(&mut |_, _| {}).await;
    let made = made.map(|finished| finished.dives.len()).map_err(|error| error.to_string());
    assert_eq!(campaign.maker.counts().cached(), 0);
    (lost.plans.load(Ordering::Relaxed), made)
}

#[tokio::test]
async fn lost_dives_are_sent_again_while_their_number_decreases() {
    assert_eq!(sent(2).await, (3, Ok(5)));
    let (plans, made) = sent(0).await;
    assert_eq!(plans, 1);
    assert!(made.unwrap_err().contains("lost"));
}
